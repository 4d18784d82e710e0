"""The decimation test: simplify a dense mesh, refine the coarse one, compare with the dense one.

Source: Liu, Kim, Chaudhuri, Aigerman, Jacobson 2020, Neural Subdivision (the evaluation on
simplified meshes). They simplify at random; here the simplification is fixed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import fast_simplification
import numpy as np
from jaxtyping import Float, Int

from pns_common.arrays import cross, dot, norm
from pns_common.frames import face_normals
from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.schemes import Scheme
from train.dense_meshes import DenseMesh, asset_meshes, cad_meshes, is_manifold, largest_part
from train.point_mesh import BoxTree, box_tree, farthest, nearest

COARSE_FACES = 800
"""About 400 vertices on a closed mesh, as in the source."""

LEAST_REDUCTION = 5
"""The dense mesh has at least so many times the faces of the coarse one."""

AGGRESSIVENESS = 5.0
"""How fast the simplification raises its threshold: below the library's 7, for better triangles."""

SEARCH = 9
"""How many counts of faces near the target are tried for a manifold."""

SAMPLES = 10_000
"""Sample points on each of the two surfaces."""

SEED = 0


@dataclass(frozen=True, slots=True)
class Pair:
    """A dense mesh and what was left of it.

    Attributes:
        cut_off: faces of the simplification that were pinched off, and left out.
    """

    dense: DenseMesh
    coarse: Mesh
    cut_off: int


@dataclass(frozen=True, slots=True)
class NotSimplified:
    """A dense mesh of which no simplification was a manifold like itself."""

    dense: DenseMesh


@dataclass(frozen=True, slots=True)
class SurfaceErrors:
    """How far two surfaces are apart, both ways; lengths in the dense mesh's diagonal.

    Attributes:
        mean: mean distance of a surface's points from the other surface, mean of both ways.
        p95: 95th percentile of that distance, mean of both ways.
        hausdorff: the largest distance found, vertices included.
        normal: mean angle between the faces at a point and at its nearest point, mean of both
            ways, radians.
    """

    mean: float
    p95: float
    hausdorff: float
    normal: float


SURFACE_METRICS = tuple(field.name for field in fields(SurfaceErrors))


@dataclass(frozen=True, slots=True)
class Row:
    """The errors of one method on one mesh after so many levels."""

    mesh: str
    level: int
    method: str
    errors: SurfaceErrors


def simplified_pairs(assets: Path | None = None) -> list[Pair]:
    """Return all pairs of the test: those of a folder's files, if given, and the CAD-like parts."""
    dense = [] if assets is None else list(asset_meshes(assets))
    taken = [one for one in dense if isinstance(one, DenseMesh)] + cad_meshes()
    return [pair for pair in map(simplify, taken) if isinstance(pair, Pair)]


def simplify(dense: DenseMesh) -> Pair | NotSimplified:
    """Simplify a dense mesh to `COARSE_FACES`, or to a fifth of its faces if that is less.

    Edge collapses, as fast-simplification does them, may pinch off a few faces that then hang on
    an edge of four: those are cut off. Of the counts nearest to the target, the first is taken that
    gives a manifold of the same Euler characteristic.
    """
    target = min(COARSE_FACES, len(dense.mesh.faces) // LEAST_REDUCTION)
    wanted = euler_characteristic(dense.mesh)
    for tries in range(SEARCH):
        # target, then 2 more, 2 less, 4 more, ...
        count = target + (tries + 1) // 2 * (2 if tries % 2 else -2)
        whole = collapsed(dense.mesh, count)
        coarse = largest_part(whole)
        if is_manifold(coarse) and euler_characteristic(coarse) == wanted:
            return Pair(dense, coarse, len(whole.faces) - len(coarse.faces))
    return NotSimplified(dense)


def collapsed(mesh: Mesh, faces: int) -> Mesh:
    """Return what quadric edge collapses leave of a mesh at about a number of faces."""
    vertices, triangles = fast_simplification.simplify(
        mesh.vertices.copy(), mesh.faces.copy(), target_count=faces, agg=AGGRESSIVENESS
    )
    used, number = np.unique(triangles, return_inverse=True)
    return Mesh(vertices[used], number.reshape(-1, 3))


def euler_characteristic(mesh: Mesh) -> int:
    """V − E + F, over the vertices in use."""
    ends = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    used = len(np.unique(mesh.faces))
    return used - len(np.unique(ends, axis=0)) + len(mesh.faces)


def compare(
    pairs: Iterable[Pair],
    schemes: Mapping[str, Scheme],
    levels: Iterable[int] = (2, 3),
    samples: int = SAMPLES,
) -> list[Row]:
    """Refine every coarse mesh by every scheme and measure it against its dense mesh."""
    rows, wanted = [], sorted(levels)
    for pair in pairs:
        target = Target(pair.dense.mesh, samples)
        for method, scheme in schemes.items():
            for level in wanted:
                refined = refine(pair.coarse, scheme, level, threads=1).mesh
                rows.append(Row(pair.dense.name, level, method, target.errors(refined)))
    return rows


class Target:
    """A dense mesh, prepared once for many comparisons."""

    def __init__(self, dense: Mesh, samples: int = SAMPLES) -> None:
        self.surface = _sampled(dense, samples)
        self.diagonal = float(np.linalg.norm(np.ptp(dense.vertices, axis=0)))

    def errors(self, refined: Mesh) -> SurfaceErrors:
        """Measure a refined mesh."""
        other = _sampled(refined, len(self.surface.points))
        there, back = _one_way(other, self.surface), _one_way(self.surface, other)
        return SurfaceErrors(
            mean=(there.mean + back.mean) / 2 / self.diagonal,
            p95=(there.p95 + back.p95) / 2 / self.diagonal,
            hausdorff=max(there.hausdorff, back.hausdorff) / self.diagonal,
            normal=(there.normal + back.normal) / 2,
        )


@dataclass(frozen=True, eq=False, slots=True)
class _Sampled:
    """A surface with its tree, its sample points and its faces' normals."""

    tree: BoxTree
    vertices: Float[np.ndarray, "V 3"]
    normals: Float[np.ndarray, "F 3"]
    points: Float[np.ndarray, "P 3"]
    sample_face: Int[np.ndarray, " P"]


def _sampled(mesh: Mesh, samples: int) -> _Sampled:
    points, face = surface_samples(mesh, samples, np.random.default_rng(SEED))
    return _Sampled(
        tree=box_tree(mesh),
        vertices=mesh.vertices,
        normals=face_normals(mesh.vertices, mesh.faces),
        points=points,
        sample_face=face,
    )


def surface_samples(
    mesh: Mesh, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "N 3"], np.ndarray]:
    """Return points spread evenly by area, and their faces.

    Stratified: one point in each of `count` pieces of equal area, in the order of the faces, so
    that means over two surfaces with like faces differ by the surfaces and hardly by the draw.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    area = norm(cross(b - a, c - a))
    upto = np.cumsum(area)
    place = (np.arange(count) + rng.random(count)) / count * upto[-1]
    face = np.searchsorted(upto, place, side="right").clip(max=len(area) - 1)
    u, v = rng.random((2, count, 1))
    # The square's upper half is folded onto the triangle.
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return a[face] + u * (b - a)[face] + v * (c - a)[face], face


def _one_way(source: _Sampled, target: _Sampled) -> SurfaceErrors:
    found = nearest(target.tree, source.points)
    here = source.normals[source.sample_face]
    there = target.normals[found.face]
    angle = np.arctan2(norm(cross(here, there)), dot(here, there))
    return SurfaceErrors(
        mean=float(found.distance.mean()),
        p95=float(np.percentile(found.distance, 95)),
        hausdorff=farthest(target.tree, source.vertices, float(found.distance.max())),
        normal=float(angle.mean()),
    )
