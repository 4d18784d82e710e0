"""Solids of plane faces and sharp edges, simplified: what refinement meets in mechanical parts.

Convex polyhedra, and blocks: boxes joined and cut away on an uneven grid, with steps, pockets and
thin walls.
"""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull

from pns_common import Mesh
from train.connectivity import connect
from train.data.dense_meshes import is_manifold, largest_part
from train.data.pairs.references import Pair, Reference, coarsened

# Of the split polyhedron that is then simplified.
FEWEST_FACES, MOST_FACES = 1500, 8000

SAMPLES = 12_000
FEWEST, MOST = 20, 1500
# How often it is a block; else a convex polyhedron.
BLOCKS = 0.6

# How often a convex one is a box, or a prism; else the hull of random points.
BOXES, PRISMS = 0.2, 0.4

# How often it is left as it is, with as few faces as modellers draw.
AS_DRAWN = 0.4

# Cells along each side of a block's grid.
CELLS = 5

# Widths of its cells, even by logarithm.
THINNEST, WIDEST = 0.08, 1.0


def faceted_pair(rng: np.random.Generator) -> Pair | None:
    """Return a coarse mesh of a random polyhedron; None where collapses spoilt it."""
    made = polyhedron(rng)
    if made is None:
        return None
    points, faces = made
    if rng.random() < AS_DRAWN:
        return Pair("faceted", Mesh(points, faces), sampled(points, faces, rng))
    dense, triangles = points, faces
    while len(triangles) < FEWEST_FACES:
        level = connect(triangles, len(dense))
        dense = np.concatenate([dense, dense[level.edges.numpy()].mean(axis=1)])
        triangles = level.split().numpy()
    if len(triangles) > MOST_FACES:
        return None
    # A breath of noise: exact planes leave the order of the collapses to rounding.
    noise = 1e-4 * np.ptp(dense) * rng.normal(size=dense.shape)
    count = int(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST))))
    coarse = coarsened(dense + noise, triangles, min(count, len(triangles) // 2), rng)
    if coarse is None:
        return None
    return Pair("faceted", coarse, sampled(points, faces, rng))


def polyhedron(
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]] | None:
    """Return the surface of a block, or a convex hull; None where it is no manifold."""
    return block(rng) if rng.random() < BLOCKS else _hull(_corners(rng))


def block(
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]] | None:
    """Return the surface of a few boxes of grid cells; None where it is no manifold."""
    filled = np.zeros((CELLS + 2,) * 3, dtype=bool)
    filled[_range(rng)] = True
    for _ in range(int(rng.integers(0, 4))):
        filled[_range(rng)] = rng.random() < 0.5
    if not filled.any():
        return None
    logarithms = rng.uniform(np.log(THINNEST), np.log(WIDEST), (3, CELLS + 2))
    lines = np.concatenate([np.zeros((3, 1)), np.cumsum(np.exp(logarithms), axis=1)], axis=1)
    corners = []
    for axis, (u, v) in enumerate(((1, 2), (2, 0), (0, 1))):
        for side in (0, 1):
            beyond = np.roll(filled, 1 - 2 * side, axis=axis)
            low = np.argwhere(filled & ~beyond)
            low[:, axis] += side
            quad = np.repeat(low[:, None], 4, axis=1)
            quad[:, 1:3, u] += 1
            quad[:, 2:4, v] += 1
            corners.append(quad if side else quad[:, ::-1])
    quads = np.concatenate(corners)
    nodes, number = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    faces = number.reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    points = np.stack([lines[axis][nodes[:, axis]] for axis in range(3)], axis=1)
    mesh = largest_part(Mesh(points, faces))
    return (mesh.vertices, mesh.faces) if is_manifold(mesh) else None


def _range(rng: np.random.Generator) -> tuple[slice, ...]:
    """Return a random box of cells, inside the border."""
    ends = np.sort(rng.integers(0, CELLS, (3, 2)), axis=1)
    return tuple(slice(int(low) + 1, int(high) + 2) for low, high in ends)


def _corners(rng: np.random.Generator) -> Float[np.ndarray, "N 3"]:
    kind, size = rng.random(), np.exp(rng.uniform(-1.2, 0.6, 3))
    if kind < BOXES:
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        return signs * size
    if kind < BOXES + PRISMS:
        count, taper = int(rng.integers(3, 7)), rng.uniform(0.3, 1.0)
        angle = 2 * np.pi * np.arange(count) / count
        ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        return np.concatenate([ring - [0, 0, 1], ring * [taper, taper, 1] + [0, 0, 1]]) * size
    return rng.normal(size=(int(rng.integers(6, 16)), 3)) * size


def _hull(
    corners: Float[np.ndarray, "N 3"],
) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Return the convex hull, faces anticlockwise from outside."""
    hull = ConvexHull(corners)
    faces = hull.simplices.astype(np.int64)
    a, b, c = (corners[faces[:, corner]] for corner in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces = np.where(inward[:, None], faces[:, ::-1], faces)
    used, number = np.unique(faces, return_inverse=True)
    return corners[used], number.reshape(-1, 3)


def sampled(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    rng: np.random.Generator,
    samples: int = SAMPLES,
) -> Reference:
    """Return so many points spread evenly by area, with their faces' normals."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    face = rng.choice(len(faces), samples, p=area / area.sum())
    u, v = np.sort(rng.random((2, samples, 1)), axis=0)
    on_faces = a[face] * u + b[face] * (v - u) + c[face] * (1 - v)
    return Reference(on_faces, across[face] / area[face, None])
