"""Faces where the surface bends, beside other ways to the same error: results/few_faces.md.

python -m benchmarks.few_faces ../shared/assets/dense 7      # of so many shapes

Each coarse mesh of the validation is refined by PNS. Its limit surface is level FINE. A mesh's
error is the largest distance of that level's vertices from it, in per cent of the diagonal. Rows
that have a number to choose take the largest at which the error is at most TOLERANCE.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pns_common import Mesh, clean, refine
from pns_common.files import replace_file
from train.data.validation import coarse_mesh, read_shape, validation_meshes
from train.metrics.self_intersection import crossing_faces
from train.metrics.surface_distance import face_tree, nearest

ROOT = Path(__file__).resolve().parents[1]
OUTPUT = ROOT / "results" / "few_faces.md"
TOLERANCE, FINE, FACES, HALVINGS = 0.1, 4, 700, 6
# Kinds that have flat faces; the others bend everywhere.
FLAT_KINDS = ("part", "game", "building")
UNIFORM = "Whole levels"
ABOUT = """# Faces only where the surface bends, beside other ways

`python -m benchmarks.few_faces DENSE {count}` on {count} coarse meshes of at most {faces} faces, of
shapes of the validation. *Error*: the largest distance of the limit surface (level {fine}) from
the mesh, in per cent of the diagonal. *Faces*: over those of the first whole level whose error is
at most {tolerance} %, or the last of {last}. Both are medians. *Borders*: how many more the meshes
have than the control meshes, in all: a crack is one. *Crossing*: the share of faces that pass
through others, the mean.
"""


@dataclass(frozen=True)
class Row:
    """One mesh made in one way: its faces, error, new borders and share of crossing faces."""

    faces: int
    error: float
    borders: int
    crossing: float


@dataclass(frozen=True, eq=False)
class Truth:
    """A coarse mesh, and points of the limit surface that it becomes."""

    coarse: Mesh
    points: np.ndarray
    size: float

    def error(self, mesh: Mesh) -> float:
        """Return the largest distance of the limit surface from a mesh, in % of the diagonal."""
        return 100 * float(nearest(face_tree(mesh), self.points).distance.max()) / self.size

    def row(self, mesh: Mesh) -> Row:
        """Measure a mesh."""
        return Row(
            mesh.face_count,
            self.error(mesh),
            borders(mesh) - borders(self.coarse),
            float(crossing_faces(mesh).mean()),
        )

    def largest(self, low: float, high: float, make: Callable[[float], Mesh]) -> Mesh:
        """Return what is made of the largest number whose error is small enough."""
        made = make(low)
        for _ in range(HALVINGS):
            middle = float(np.sqrt(low * high))
            tried = make(middle)
            if self.error(tried) <= TOLERANCE:
                low, made = middle, tried
            else:
                high = middle
        return made


def borders(mesh: Mesh) -> int:
    """Return how many runs of open edges there are, where vertices in one place are one."""
    _, place = np.unique(np.round(mesh.vertices, 9), axis=0, return_inverse=True)
    faces = place.reshape(-1)[mesh.faces]
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, counts = np.unique(sides, axis=0, return_counts=True)
    ends, rows = np.unique(edges[counts == 1], return_inverse=True)
    pairs = rows.reshape(-1, 2)
    joined = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(ends), len(ends)))
    return int(connected_components(joined, directed=False)[0])


def ways(truth: Truth) -> Iterator[tuple[str, Mesh]]:
    """Yield each way by its name, with the mesh that it makes."""
    coarse = truth.coarse
    levels = [refine(coarse, "pns", level).mesh for level in range(1, FINE)]
    first = next((n for n, made in enumerate(levels) if truth.error(made) <= TOLERANCE), FINE - 2)
    uniform = levels[first]
    yield UNIFORM, uniform
    yield "The control mesh", coarse
    yield "PNS, tolerance=0.1% (proved)", adaptive(coarse, TOLERANCE)
    yield (
        "PNS, the tolerance whose error is measured",
        truth.largest(TOLERANCE, 32 * TOLERANCE, lambda share: adaptive(coarse, share)),
    )
    finer = levels[min(first + 1, len(levels) - 1)]

    def fewer(times: float) -> Mesh:
        return simplified(finer, finer.face_count / times)

    yield "Whole levels, one more, then meshoptimizer's simplify", truth.largest(1.0, 64.0, fewer)
    sides = uniform.vertices[uniform.faces]
    longest = float(np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).max())
    flat = pyvista.PolyData.from_regular_faces(coarse.vertices, coarse.faces)
    flat = flat.subdivide_adaptive(max_edge_len=longest, max_n_passes=20)
    yield (
        "VTK's adaptive filter, to the sides of whole levels",
        as_mesh(flat.points, flat.regular_faces),
    )
    cut = trimesh.remesh.subdivide_to_size(coarse.vertices, coarse.faces, longest, max_iter=20)
    yield "trimesh's subdivide_to_size, likewise", as_mesh(cut[0], cut[1])


def adaptive(coarse: Mesh, share: float) -> Mesh:
    """Refine a mesh to a tolerance in % of its diagonal."""
    return refine(coarse, "pns", tolerance=f"{share}%").mesh


def as_mesh(points: np.ndarray, faces: np.ndarray) -> Mesh:
    """Return a mesh of another library's arrays."""
    return Mesh(np.asarray(points, dtype=np.float64), np.asarray(faces, dtype=np.int64))


def simplified(mesh: Mesh, faces: float) -> Mesh:
    """Simplify a mesh to about so many faces."""
    corners, points = mesh.faces.astype("<u4"), mesh.vertices.astype("<f4")
    head = np.array([corners.size, points.size], dtype="<u4")
    program = ROOT / "benchmarks" / "peers" / "simplify.mjs"
    answer = subprocess.run(
        ["node", program, ROOT / "web", str(3 * int(faces))],
        input=head.tobytes() + corners.tobytes() + points.tobytes(),
        capture_output=True,
        check=True,
    ).stdout
    kept = np.frombuffer(answer, dtype="<u4")[1:].reshape(-1, 3).astype(np.int64)
    return clean(Mesh(mesh.vertices, kept)).mesh


def main() -> None:
    """Measure all ways on some coarse meshes, and write the table."""
    folder, most = Path(sys.argv[1]), int(sys.argv[2])
    rows: dict[str, dict[str, list[Row]]] = {"parts, games, buildings": {}, "others": {}}
    drawn, names = [d for d in validation_meshes(folder) if d.faces == FACES], set[Path]()
    for each in drawn:
        if each.path in names or len(names) == most:
            continue
        coarse = coarse_mesh(read_shape(each.path, each.kind), each)
        if coarse is None:
            continue
        names.add(each.path)
        size = float(np.linalg.norm(np.ptp(coarse.vertices, axis=0)))
        truth = Truth(coarse, refine(coarse, "pns", FINE).mesh.vertices, size)
        group = rows["parts, games, buildings" if each.kind in FLAT_KINDS else "others"]
        for way, mesh in ways(truth):
            group.setdefault(way, []).append(truth.row(mesh))
            print(each.path.stem, each.kind, way, group[way][-1], flush=True)
        replace_file(OUTPUT, report(rows, len(names)).encode())


def report(rows: dict[str, dict[str, list[Row]]], count: int) -> str:
    """Return the tables of some shapes."""
    text = ABOUT.format(count=count, faces=FACES, fine=FINE, tolerance=TOLERANCE, last=FINE - 1)
    for group, measured in rows.items():
        if not measured:
            continue
        text += f"\n## {group.capitalize()}: {len(measured[UNIFORM])}\n\n"
        text += "| | Faces | Error | Borders | Crossing |\n|---|---|---|---|---|\n"
        base = np.array([row.faces for row in measured[UNIFORM]])
        for way, own in measured.items():
            share = np.median(np.array([row.faces for row in own]) / base)
            error = np.median([row.error for row in own])
            lost = sum(row.borders for row in own)
            crossing = 100 * np.mean([row.crossing for row in own])
            text += f"| {way} | {100 * share:.0f} % | {error:.3f} | {lost:,} | {crossing:.1f} % |\n"
    return text


if __name__ == "__main__":
    main()
