"""Where the descendants of a quad lie, as points of the grids of its two triangles."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Int

from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK
from pns_common.topology import build_topology

from .barycentric_grid import barycentric_grid

# The triangles of a quad, and of one whose corners run the other way round.
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
TURNED = np.array([[0, 3, 2], [0, 2, 1]])


def at_quad_points(
    corners: Int[np.ndarray, "H C"], levels: int, *, turned: bool = False
) -> Int[np.ndarray, "P T"]:
    """Return labels at the grid points of both triangles of each quad.

    Args:
        corners: labels at the corners of the quad's descendants after so many levels, in order.
        levels: how many.
        turned: whether the triangles run the other way round.
    """
    slots = _slots(levels)[2:] if turned else _slots(levels)[:2]
    return corners[:, slots].reshape(2 * len(corners), -1)


@lru_cache(maxsize=8)
def _slots(levels: int) -> Int[np.ndarray, "4 T"]:
    """Return which corner of the descendants is at each point, for HALVES and TURNED."""
    segments = 2**levels
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    points, faces = segments * square, np.arange(4)[None]
    for _ in range(levels):
        offsets = 4 * np.arange(len(faces) + 1)
        mesh = build_topology((faces.reshape(-1), offsets), len(points))
        middles = points[mesh.edges].sum(axis=1) // 2
        points = np.concatenate([points, middles, points[faces].sum(axis=1) // 4])
        faces = CATMULL_CLARK.faces(mesh, Blocks(), np.int64)
    at = np.empty((segments + 1, segments + 1), dtype=np.int64)
    at[tuple(points[faces.reshape(-1)].T)] = np.arange(faces.size)
    weights = barycentric_grid(levels).points
    return np.stack([at[tuple((weights @ square[own]).T)] for own in (*HALVES, *TURNED)])
