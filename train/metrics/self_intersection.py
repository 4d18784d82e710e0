"""Faces of a mesh that pass through another face, away from what the two share."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit
from numba.extending import register_jitable

from pns_common.fused.kernels.rings import between, cross, dot
from pns_common.mesh import Mesh

CELL = 1.5
"""Side of a cell, in mean side lengths of the faces' boxes."""

MOST_CELLS = 1 << 20
"""Cells along one side of the grid, at most: three of them fit into an int64 key."""

SLACK = 1e-12
"""Crossings this close to a border, as a share of a triangle, are no crossings."""

Corners = Float[np.ndarray, "N 3 3"]

for helper in (between, cross, dot):
    register_jitable(helper)


def self_intersecting(mesh: Mesh) -> Bool[np.ndarray, " F"]:
    """Return which faces an edge of another face passes through, or the reverse.

    Faces that share an edge are not looked at, nor are faces in one plane. Of faces that share a
    vertex only the edges opposite it are: the others meet the other face's plane there already, and
    where the two are almost in one plane rounding would decide.
    """
    crossing = np.zeros(len(mesh.faces), dtype=np.bool_)
    corners = mesh.vertices[mesh.faces]
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    origin = lower.min(axis=0)
    side = max(CELL * float((upper - lower).mean()), float(np.ptp(upper)) / MOST_CELLS, 1e-300)
    keys, face = _entries(lower, upper, origin, side)
    _mark(mesh.vertices, mesh.faces, lower, upper, origin, side, keys, face, crossing)
    return crossing


def _entries(
    lower: Float[np.ndarray, "F 3"],
    upper: Float[np.ndarray, "F 3"],
    origin: Float[np.ndarray, " 3"],
    side: float,
) -> tuple[Int[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return for each cell that a face's box touches the cell's key and the face, by key."""
    first = np.floor((lower - origin) / side).astype(np.int64)
    span = np.floor((upper - origin) / side).astype(np.int64) - first + 1
    copies = span.prod(axis=1)
    face = np.repeat(np.arange(len(lower)), copies)
    place = np.arange(len(face)) - np.repeat(np.cumsum(copies) - copies, copies)
    rows = span[face]
    steps = np.stack(
        [place % rows[:, 0], place // rows[:, 0] % rows[:, 1], place // (rows[:, 0] * rows[:, 1])],
        axis=1,
    )
    cell = first[face] + steps
    keys = (cell[:, 0] * MOST_CELLS + cell[:, 1]) * MOST_CELLS + cell[:, 2]
    order = np.argsort(keys, kind="stable")
    return keys[order], face[order]


@njit(cache=True)
def _mark(vertices, faces, lower, upper, origin, side, keys, face, crossing):
    """Mark the faces that cross another one of a cell."""
    for entry in range(len(keys)):
        later = entry + 1
        while later < len(keys) and keys[later] == keys[entry]:
            i, j = face[entry], face[later]
            later += 1
            if crossing[i] and crossing[j]:
                continue
            if _boxes_meet_here(lower, upper, origin, side, i, j, keys[entry]) and _cross(
                vertices, faces[i], faces[j]
            ):
                crossing[i] = crossing[j] = True


@njit(cache=True)
def _boxes_meet_here(lower, upper, origin, side, i, j, key):
    """Whether two boxes overlap and their common corner lies in this cell, as in one alone."""
    here = 0
    for axis in range(3):
        low = max(lower[i, axis], lower[j, axis])
        if low > min(upper[i, axis], upper[j, axis]):
            return False
        here = here * MOST_CELLS + math.floor((low - origin[axis]) / side)
    return here == key


@njit(cache=True)
def _cross(vertices, first, second):
    """Whether an edge of either triangle passes through the other; never where they share two."""
    shared = 0
    for corner in first:
        shared += _is_of(corner, second)
    if shared > 1:
        return False
    return _edge_pierces(vertices, first, second) or _edge_pierces(vertices, second, first)


@njit(cache=True)
def _is_of(vertex, triangle):
    return vertex == triangle[0] or vertex == triangle[1] or vertex == triangle[2]


@njit(cache=True)
def _edge_pierces(vertices, edges, triangle):
    for corner in range(3):
        start, end = edges[corner], edges[(corner + 1) % 3]
        if (
            not _is_of(start, triangle)
            and not _is_of(end, triangle)
            and _pierces(vertices, start, end, triangle)
        ):
            return True
    return False


@njit(cache=True)
def _pierces(vertices, start, end, triangle):
    """Whether a segment passes through a triangle (Möller and Trumbore 1997)."""
    a, b, c = triangle
    u, v = between(vertices, a, b), between(vertices, a, c)
    along, offset = between(vertices, start, end), between(vertices, a, start)
    side = cross(along, v)
    volume = dot(u, side)
    if abs(volume) <= SLACK * math.sqrt(dot(u, u) * dot(v, v) * dot(along, along)):
        return False
    lifted = cross(offset, u)
    first, second = dot(offset, side) / volume, dot(along, lifted) / volume
    reach = dot(v, lifted) / volume
    inside = first > SLACK and second > SLACK and first + second < 1 - SLACK
    return inside and SLACK < reach < 1 - SLACK
