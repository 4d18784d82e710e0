"""Training pairs of real shapes: each simplified by all simplifiers, as it is and changed."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float

from pns_common import Mesh, MeshError, clean
from train.data.dense_meshes import read_mesh, welded
from train.data.pairs.faceted import sampled
from train.data.pairs.polygons import REMESHERS
from train.data.pairs.references import Pair
from train.data.remeshers import with_points
from train.data.simplifiers import SIMPLIFIERS, Simplifier
from train.surfaces.solids import random_rotation

# Points of a shape.
POINTS = 40_000

# Coarse faces: log-uniform between neighbours of these, the first range so often.
SIZES, SMALL = (300, 2000, 6000), 0.85

# The dense mesh has at least so many times the coarse one's faces, and these so many.
LEAST_REDUCTION, FEWEST = 3, 60

# Largest logarithm of a stretch; how often a changed shape is cut, and keeps at least which share.
STRETCH, CUT, KEPT = 0.35, 0.4, 0.3

# How often a coarse mesh has noise, and of how many mean edge lengths at most.
NOISY, NOISE = 0.15, 0.06

# Simplifiers of a changed shape.
CHANGED = 3


def shape_pairs(
    path: Path, kind: str, seed: int, *, polygons: bool = False
) -> Iterator[list[Pair]]:
    """Yield pairs of one surface each time: of the shape as it is, then of changed ones.

    Args:
        path: dense mesh, in any unit; results have a bounding box of diagonal 1.
        kind: its kind.
        seed: of sizes, changes and noise.
        polygons: remesh in quads, in place of simplifying.
    """
    rng = np.random.default_rng(seed)
    dense = read_mesh(path)
    makers = REMESHERS if polygons else SIMPLIFIERS
    names = list(makers)
    yield _simplified(kind, dense, makers, names, rng)
    for turn in range(3 if kind == "terrain" else 1):
        first = seed + CHANGED * turn
        chosen = [names[(first + 2 * step) % len(names)] for step in range(CHANGED)]
        other = changed(dense, rng, always_cut=kind == "terrain")
        yield _simplified(kind, other, makers, chosen, rng)


def changed(mesh: Mesh, rng: np.random.Generator, *, always_cut: bool = False) -> Mesh:
    """Return a mesh stretched along random axes, and cut by a plane now and then."""
    turn = random_rotation(rng)
    stretched = with_points(mesh, mesh.vertices @ turn * np.exp(rng.uniform(-STRETCH, STRETCH, 3)))
    if rng.random() > CUT and not always_cut:
        return stretched
    corners = stretched.vertices[stretched.faces]
    level = np.quantile(corners.mean(axis=1)[:, 0], rng.uniform(0.1, 1 - KEPT))
    points, faces, _ = trimesh.intersections.slice_faces_plane(
        stretched.vertices.copy(), stretched.faces.copy(), np.array([1.0, 0, 0]), [level, 0, 0]
    )
    try:
        return welded(Mesh(points, faces))
    except MeshError:
        return stretched


def _simplified(
    kind: str,
    dense: Mesh,
    makers: Mapping[str, Simplifier],
    names: list[str],
    rng: np.random.Generator,
) -> list[Pair]:
    low, high = dense.vertices.min(axis=0), dense.vertices.max(axis=0)
    dense = with_points(dense, (dense.vertices - (low + high) / 2) / np.linalg.norm(high - low))
    surface = sampled(dense.vertices, dense.faces, rng, POINTS)
    made = []
    for name in names:
        ends = SIZES[:2] if rng.random() < SMALL else SIZES[1:]
        faces = int(np.exp(rng.uniform(*np.log(ends))))
        noise = rng.uniform(0, NOISE) if rng.random() < NOISY else 0.0
        try:
            most = max(len(dense.faces) // LEAST_REDUCTION, FEWEST)
            coarse = clean(makers[name](dense, min(faces, most))).mesh
        except MeshError:
            continue
        if coarse.face_count >= FEWEST:
            made.append(Pair(f"{kind}/{name}", _shaken(coarse, noise, rng), surface))
    return made


def _shaken(mesh: Mesh, noise: float, rng: np.random.Generator) -> Mesh:
    ends = mesh.vertices[mesh.topology().edges]
    length = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    shifts: Float[np.ndarray, "V 3"] = rng.normal(size=mesh.vertices.shape)
    return with_points(mesh, mesh.vertices + noise * length / np.sqrt(3) * shifts)
