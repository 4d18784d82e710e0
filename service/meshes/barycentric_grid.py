"""Barycentric grid of the 4^L descendants of one triangle after L splits.

Linear attributes need no level-by-level refinement: midpoints of midpoints are the points of this
grid. It is made by the operator's own split, so faces and corners come in the operator's order. The
descendants of a quad lie at the points of the grids of its two triangles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Int

from pns_common.mesh.topology import build_topology, split_faces
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK

# The triangles of a quad, and of one whose corners run the other way round.
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
TURNED = np.array([[0, 3, 2], [0, 2, 1]])


@dataclass(frozen=True, eq=False)
class BarycentricGrid:
    """The T = (n + 1)(n + 2) / 2 points of a triangle split L times; n = 2^L segments a side.

    Attributes:
        segments: n.
        points: (T, 3) barycentric coordinates times n; points 0, 1, 2 are the corners.
        faces: (4^L, 3) points of each descendant.
        slot: (T,) for each point one of the 3 · 4^L corners of `faces` (flattened) that is it.
        sides: (3, n − 1) points inside the side from corner k to corner k + 1, in that order.
        inner: (I,) points inside the triangle.
        owner: (T,) what has each point: a corner (0, 1, 2), a side (3, 4, 5) or the inside (6).
        place: (8, T) which of its owner's points each is, where those sides k run backwards that
            have bit 2ᵏ in the row's number.
        reorder: (9, T) for a triangle whose corners 0 and 1 are corners i and j of another, row
            3 i + j says which point of the other each of its points is.
    """

    segments: int
    points: Int[np.ndarray, "T 3"]
    faces: Int[np.ndarray, "D 3"]
    slot: Int[np.ndarray, " T"]
    sides: Int[np.ndarray, "3 n"]
    inner: Int[np.ndarray, " I"]
    owner: Int[np.ndarray, " T"]
    place: Int[np.ndarray, "8 T"]
    reorder: Int[np.ndarray, "9 T"]


@lru_cache(maxsize=8)
def barycentric_grid(levels: int) -> BarycentricGrid:
    """Make the grid after `levels` splits."""
    segments = 2**levels
    points = segments * np.eye(3, dtype=np.int64)
    faces = np.array([[0, 1, 2]])
    for _ in range(levels):
        topology = build_topology(faces, len(points))
        a, b = topology.edges.T
        points = np.concatenate([points, (points[a] + points[b]) // 2])
        faces = split_faces(topology, Blocks(), np.int64)
    number_at = np.full((segments + 1, segments + 1), -1, dtype=np.int64)
    number_at[points[:, 0], points[:, 1]] = np.arange(len(points))
    slot = np.empty(len(points), dtype=np.int64)
    slot[faces.reshape(-1)] = np.arange(faces.size)
    sides, inner = _sides(number_at, segments), np.flatnonzero((points > 0).all(axis=1))
    owner, place = _owners(sides, inner)
    return BarycentricGrid(
        segments=segments,
        points=points,
        faces=faces,
        slot=slot,
        sides=sides,
        inner=inner,
        owner=owner,
        place=place,
        reorder=_reorder(number_at, points),
    )


def _sides(number_at: Int[np.ndarray, "S S"], segments: int) -> Int[np.ndarray, "3 n"]:
    step = np.arange(1, segments)
    zero = np.zeros_like(step)
    return np.stack(
        [number_at[segments - step, step], number_at[zero, segments - step], number_at[step, zero]]
    )


def _owners(
    sides: Int[np.ndarray, "3 n"], inner: Int[np.ndarray, " I"]
) -> tuple[Int[np.ndarray, " T"], Int[np.ndarray, "8 T"]]:
    owner = np.empty(3 + sides.size + len(inner), dtype=np.int64)
    place = np.zeros((8, len(owner)), dtype=np.int64)
    owner[:3], owner[inner] = range(3), 6
    place[:, inner] = np.arange(len(inner))
    for side, points in enumerate(sides):
        owner[points] = 3 + side
        for row in range(8):
            along = points[::-1] if row >> side & 1 else points
            place[row, along] = np.arange(len(points))
    return owner, place


def _reorder(
    number_at: Int[np.ndarray, "S S"], points: Int[np.ndarray, "T 3"]
) -> Int[np.ndarray, "9 T"]:
    rows = np.zeros((9, len(points)), dtype=np.int64)
    for first in range(3):
        for second in {0, 1, 2} - {first}:
            order = [first, second, 3 - first - second]
            other = np.empty_like(points)
            other[:, order] = points
            rows[3 * first + second] = number_at[other[:, 0], other[:, 1]]
    return rows


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
