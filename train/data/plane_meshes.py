"""Coarse meshes of the square [−1, 1]², of several resolutions and connectivities.

They are lifted onto analytic surfaces: a regular grid has interior valence 6 alone, one with turned
diagonals has 4 … 8, a Delaunay triangulation of scattered points what comes.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import Delaunay


@dataclass(frozen=True, slots=True)
class PlaneMesh:
    """A triangulated square; faces anticlockwise."""

    points: Float[np.ndarray, "V 2"]
    faces: Int[np.ndarray, "F 3"]


def regular_grid(rng: np.random.Generator, side: int, jitter: float) -> PlaneMesh:
    """Make a grid whose diagonals all run one way, as in the paper's patch."""
    return _grid(_jittered(rng, side, jitter), np.zeros((side - 1, side - 1), dtype=bool))


def turned_grid(rng: np.random.Generator, side: int, jitter: float) -> PlaneMesh:
    """Make a grid each of whose diagonals runs either way, at random."""
    points = _jittered(rng, side, jitter)
    return _grid(points, rng.random((side - 1, side - 1)) < 0.5)


def scattered(rng: np.random.Generator, side: int, jitter: float) -> PlaneMesh:
    """Triangulate (Delaunay) a jittered grid whose rows are shifted by half a spacing."""
    points = _jittered(rng, side, jitter)
    odd = (np.arange(side * side) % side) % 2 == 1
    inside = np.abs(points[:, 0]) < 1
    points[odd & inside, 0] += 1 / (side - 1)
    points[:, 0] = np.clip(points[:, 0], -1, 1)
    simplices = Delaunay(points).simplices.astype(np.int64)
    u, v = (points[simplices[:, k]] - points[simplices[:, 0]] for k in (1, 2))
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    simplices[area < 0] = simplices[area < 0][:, ::-1]
    # Collinear points of the border span slivers.
    return PlaneMesh(points, simplices[np.abs(area) > 0.05 / (side - 1) ** 2])


def _jittered(rng: np.random.Generator, side: int, jitter: float) -> Float[np.ndarray, "V 2"]:
    axis = np.linspace(-1, 1, side)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    spacing = 2 / (side - 1)
    offsets = (rng.random(points.shape) - 0.5) * jitter * spacing
    inside = (np.abs(points) < 1).all(axis=1, keepdims=True)
    return np.where(inside, points + offsets, points)


def _grid(points: Float[np.ndarray, "V 2"], turned: np.ndarray) -> PlaneMesh:
    cells = len(turned)
    i, j = (axis.ravel() for axis in np.mgrid[:cells, :cells])
    v00 = i * (cells + 1) + j
    v10, v11, v01 = v00 + cells + 1, v00 + cells + 2, v00 + 1
    one_way = np.stack([v00, v10, v11, v00, v11, v01], axis=1)
    other = np.stack([v00, v10, v01, v10, v11, v01], axis=1)
    faces = np.where(turned.reshape(-1, 1), other, one_way).reshape(-1, 3)
    return PlaneMesh(points, faces.astype(np.int64))
