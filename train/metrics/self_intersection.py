"""Faces of a mesh that pass through another face, away from what the two share."""

import math

import numpy as np
from jaxtyping import Bool
from numba import njit
from numba.extending import register_jitable

from pns_common.fused.kernels.rings import between, cross, dot
from pns_common.mesh import Mesh

# Side of a cell, in mean side lengths of the faces' boxes.
CELL = 2.0

# Cells along one side of the grid, at most: three of them fit into an int64 key.
MOST_CELLS = 1 << 20

# Crossings this close to a border, as a share of a triangle, are no crossings.
SLACK = 1e-12

# Heights over a face's plane below this share of the face's size decide nothing.
NEARLY = 1e-9

# Times this, keys of neighbouring cells fall into bins far apart (Knuth's multiplicative hash).
SPREAD = 0x9E3779B97F4A7C15 >> 1

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
    first = np.floor((lower - origin) / side).astype(np.int64)
    last = np.floor((upper - origin) / side).astype(np.int64)
    begin, keys, face = _binned(first, last)
    boxes, planes = np.hstack([lower, upper]), _planes(mesh.vertices, mesh.faces)
    _mark(mesh.vertices, mesh.faces, boxes, planes, first, begin, keys, face, crossing)
    return crossing


@njit(cache=True)
def _binned(first, last):
    """Return for each cell that a face's box touches the cell's key and the face, bin by bin.

    Entries begin[n] … begin[n + 1] − 1 are those of bin n, of several cells perhaps.
    """
    count = 0
    for f in range(len(first)):
        touched = 1
        for axis in range(3):
            touched *= last[f, axis] - first[f, axis] + 1
        count += touched
    bins = 1
    while bins < count:
        bins *= 2
    begin = np.zeros(bins + 1, np.int64)
    keys, face = np.empty(count, np.int64), np.empty(count, np.int32)
    # First counted, then filled in from the back of each bin.
    for filling in range(2):
        for f in range(len(first)):
            for x in range(first[f, 0], last[f, 0] + 1):
                for y in range(first[f, 1], last[f, 1] + 1):
                    for z in range(first[f, 2], last[f, 2] + 1):
                        key = _key(x, y, z)
                        place = ((key * SPREAD) >> 40) & (bins - 1)
                        if filling:
                            begin[place] -= 1
                            keys[begin[place]], face[begin[place]] = key, f
                        else:
                            begin[place] += 1
        if not filling:
            for n in range(bins):
                begin[n + 1] += begin[n]
    return begin, keys, face


@njit(cache=True)
def _key(x, y, z):
    return (x * MOST_CELLS + y) * MOST_CELLS + z


@njit(cache=True)
def _planes(vertices, faces):
    """Return twice the area vector of each face, and which heights along it decide nothing."""
    planes = np.empty((len(faces), 4))
    for f in range(len(faces)):
        a, b, c = faces[f]
        u, v = between(vertices, a, b), between(vertices, a, c)
        normal = cross(u, v)
        planes[f, 0], planes[f, 1], planes[f, 2] = normal
        planes[f, 3] = NEARLY * math.sqrt(dot(normal, normal) * max(dot(u, u), dot(v, v)))
    return planes


@njit(cache=True)
def _mark(vertices, faces, boxes, planes, first, begin, keys, face, crossing):
    """Mark the faces that cross another one of a cell."""
    for n in range(len(begin) - 1):
        for entry in range(begin[n], begin[n + 1]):
            i = face[entry]
            for later in range(entry + 1, begin[n + 1]):
                j = face[later]
                if (
                    keys[later] == keys[entry]
                    and not (crossing[i] and crossing[j])
                    and _boxes_meet(boxes, i, j)
                    and _common_corner(first, i, j) == keys[entry]
                    and _cross(vertices, planes, faces, i, j)
                ):
                    crossing[i] = crossing[j] = True


@njit(cache=True)
def _boxes_meet(boxes, i, j):
    for axis in range(3):
        if boxes[i, axis] > boxes[j, axis + 3] or boxes[j, axis] > boxes[i, axis + 3]:
            return False
    return True


@njit(cache=True)
def _common_corner(first, i, j):
    """Return the key of the cell where the common part of two boxes begins: one cell alone."""
    return _key(
        max(first[i, 0], first[j, 0]), max(first[i, 1], first[j, 1]), max(first[i, 2], first[j, 2])
    )


@njit(cache=True)
def _cross(vertices, planes, faces, i, j):
    """Return whether an edge of either passes through the other; never where they share two."""
    shared = 0
    for corner in range(3):
        shared += _is_of(faces[i, corner], faces, j)
    return (
        shared < 2
        and not _on_one_side(vertices, planes, faces, i, j)
        and not _on_one_side(vertices, planes, faces, j, i)
        and (_edge_pierces(vertices, faces, i, j) or _edge_pierces(vertices, faces, j, i))
    )


@njit(cache=True)
def _is_of(vertex, faces, i):
    return vertex == faces[i, 0] or vertex == faces[i, 1] or vertex == faces[i, 2]


@njit(cache=True)
def _on_one_side(vertices, planes, faces, plane, other):
    """Return whether the corners a face has alone lie clearly on one side of the other's plane."""
    above, below = False, False
    for corner in range(3):
        vertex = faces[other, corner]
        if not _is_of(vertex, faces, plane):
            height = dot(planes[plane], between(vertices, faces[plane, 0], vertex))
            above |= not height < -planes[plane, 3]
            below |= not height > planes[plane, 3]
    return not (above and below)


@njit(cache=True)
def _edge_pierces(vertices, faces, i, j):
    """Return whether an edge of face i passes through face j."""
    for corner in range(3):
        start, end = faces[i, corner], faces[i, (corner + 1) % 3]
        if (
            not _is_of(start, faces, j)
            and not _is_of(end, faces, j)
            and _pierces(vertices, start, end, faces[j, 0], faces[j, 1], faces[j, 2])
        ):
            return True
    return False


@njit(cache=True)
def _pierces(vertices, start, end, a, b, c):
    """Return whether a segment passes through a triangle (Möller and Trumbore 1997)."""
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
