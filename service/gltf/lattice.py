"""Where the 4^L descendants of one triangle lie: the lattice of barycentric points after L splits.

Linear attributes need no level-by-level refinement: midpoints of midpoints are the points of this
lattice. It is made by the operator's own split, so faces and corners come in the operator's order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Int

from pns_common.topology import build_topology, split


@dataclass(frozen=True, eq=False)
class Lattice:
    """The T = (n + 1)(n + 2) / 2 points of a triangle split L times; n = 2^L segments a side.

    Attributes:
        segments: n.
        points: (T, 3) barycentric coordinates times n; points 0, 1, 2 are the corners.
        faces: (4^L, 3) points of each descendant.
        slot: (T,) for each point one of the 3 · 4^L corners of `faces` (flattened) that is it.
        sides: (3, n − 1) points inside the side from corner k to corner k + 1, in that order.
        inner: (I,) points inside the triangle.
        reorder: (9, T) for a triangle whose corners 0 and 1 are corners i and j of another, row
            3 i + j says which point of the other each of its points is.
    """

    segments: int
    points: Int[np.ndarray, "T 3"]
    faces: Int[np.ndarray, "D 3"]
    slot: Int[np.ndarray, " T"]
    sides: Int[np.ndarray, "3 n"]
    inner: Int[np.ndarray, " I"]
    reorder: Int[np.ndarray, "9 T"]


@lru_cache(maxsize=8)
def lattice(levels: int) -> Lattice:
    """The lattice after `levels` splits."""
    segments = 2**levels
    points = segments * np.eye(3, dtype=np.int64)
    faces = np.array([[0, 1, 2]])
    for _ in range(levels):
        topology = build_topology(faces, len(points))
        a, b = topology.edges.T
        points = np.concatenate([points, (points[a] + points[b]) // 2])
        faces = split(topology)
    at = np.full((segments + 1, segments + 1), -1, dtype=np.int64)
    at[points[:, 0], points[:, 1]] = np.arange(len(points))
    slot = np.empty(len(points), dtype=np.int64)
    slot[faces.reshape(-1)] = np.arange(faces.size)
    return Lattice(
        segments=segments,
        points=points,
        faces=faces,
        slot=slot,
        sides=_sides(at, segments),
        inner=np.flatnonzero((points > 0).all(axis=1)),
        reorder=_reorder(at, points),
    )


def _sides(at: Int[np.ndarray, "S S"], segments: int) -> Int[np.ndarray, "3 n"]:
    step = np.arange(1, segments)
    zero = np.zeros_like(step)
    return np.stack([at[segments - step, step], at[zero, segments - step], at[step, zero]])


def _reorder(at: Int[np.ndarray, "S S"], points: Int[np.ndarray, "T 3"]) -> Int[np.ndarray, "9 T"]:
    rows = np.zeros((9, len(points)), dtype=np.int64)
    for first in range(3):
        for second in {0, 1, 2} - {first}:
            order = [first, second, 3 - first - second]
            other = np.empty_like(points)
            other[:, order] = points
            rows[3 * first + second] = at[other[:, 0], other[:, 1]]
    return rows
