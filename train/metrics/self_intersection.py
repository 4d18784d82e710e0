"""Faces of a mesh that pass through another face, away from what the two share."""

import math

import numpy as np
from jaxtyping import Bool
from numba import njit

from pns_common import Mesh
from train.metrics.face_boxes import (
    LOWER,
    MOST_WAITING,
    UPPER,
    WIDE,
    FaceBoxes,
    between,
    corner_of,
    cross,
    dot,
    face_boxes,
)

# Crossings this close to a border, as a share of a triangle, are no crossings.
SLACK = 1e-12

# Heights over a face's plane below this share of the face's size decide nothing.
NEARLY = 1e-9


def crossing_faces(mesh: Mesh) -> int:
    """Return how many faces of a mesh pass through others."""
    return int(self_intersecting(face_boxes(mesh)).sum())


def self_intersecting(tree: FaceBoxes) -> Bool[np.ndarray, " F"]:
    """Return which faces an edge of another face passes through, or the reverse.

    Faces that share an edge are not looked at, nor are faces in one plane. Of faces that share a
    vertex only the edges opposite it are: the others meet the other face's plane there already, and
    where the two are almost in one plane rounding would decide.
    """
    marked = np.zeros(len(tree.faces), dtype=np.bool_)
    planes = _planes(tree.corners)
    _mark(tree.faces[tree.order], tree.corners, planes, tree.boxes, tree.last_level, marked)
    crossing = np.empty_like(marked)
    crossing[tree.order] = marked
    return crossing


@njit(cache=True)
def _planes(corners):
    """Return twice the area vector of each face, and which heights along it decide nothing."""
    planes = np.empty((len(corners), 4))
    for f in range(len(corners)):
        u, v = _apart(corners, f, 0, f, 1), _apart(corners, f, 0, f, 2)
        normal = cross(u, v)
        planes[f, 0], planes[f, 1], planes[f, 2] = normal
        planes[f, 3] = NEARLY * math.sqrt(dot(normal, normal) * max(dot(u, u), dot(v, v)))
    return planes


@njit(cache=True)
def _mark(faces, corners, planes, boxes, last_level, crossing):
    """Mark the faces that cross another one: each node of the last level against the later ones."""
    nodes, whole, meets = (
        np.empty(MOST_WAITING, np.int64),
        np.empty(6),
        np.empty(WIDE, np.bool_),
    )
    for own in range(last_level, len(boxes)):
        for k in range(3):
            whole[LOWER + k] = boxes[own, LOWER + k].min()
            whole[UPPER + k] = boxes[own, UPPER + k].max()
        waiting, nodes[0] = 1, 0
        while waiting:
            waiting -= 1
            node = nodes[waiting]
            if node < last_level:
                _compare(boxes, node, whole, meets)
                for lane in range(WIDE):
                    child = WIDE * node + 1 + lane
                    if meets[lane] and (child < last_level or child >= own):
                        nodes[waiting] = child
                        waiting += 1
                continue
            first = WIDE * (own - last_level)
            for i in range(first, min(first + WIDE, len(faces))):
                _compare(boxes, node, boxes[own, :, i - first], meets)
                for lane in range(WIDE):
                    j = WIDE * (node - last_level) + lane
                    if meets[lane] and j > i and not (crossing[i] and crossing[j]):
                        crossed = _cross(faces, corners, planes, i, j)
                        crossing[i] |= crossed
                        crossing[j] |= crossed


@njit(cache=True)
def _compare(boxes, node, box, meets):
    """Note which boxes of a node a box meets."""
    for lane in range(WIDE):
        met = True
        for k in range(3):
            met &= box[LOWER + k] <= boxes[node, UPPER + k, lane]
            met &= boxes[node, LOWER + k, lane] <= box[UPPER + k]
        meets[lane] = met


@njit(cache=True)
def _cross(faces, corners, planes, i, j):
    """Return whether an edge of either passes through the other; never where they share two."""
    own = _alone(faces, i, j)
    if own[0] + own[1] + own[2] < 2:
        return False
    others = _alone(faces, j, i)
    return (
        not _on_one_side(corners, planes, i, j, others)
        and not _on_one_side(corners, planes, j, i, own)
        and (_edge_pierces(corners, i, j, own) or _edge_pierces(corners, j, i, others))
    )


@njit(cache=True)
def _alone(faces, i, j):
    """Return which corners of face i are no corners of face j."""
    a, b, c = faces[j]
    return (
        _none_of(faces[i, 0], a, b, c),
        _none_of(faces[i, 1], a, b, c),
        _none_of(faces[i, 2], a, b, c),
    )


@njit(cache=True)
def _none_of(vertex, a, b, c):
    return (vertex != a) & (vertex != b) & (vertex != c)


@njit(cache=True)
def _on_one_side(corners, planes, plane, other, alone):
    """Return whether the corners a face has alone lie clearly on one side of the other's plane."""
    above, below = False, False
    # Without a jump: which of them it has alone cannot be foreseen.
    for corner in range(3):
        height = dot(planes[plane], _apart(corners, plane, 0, other, corner))
        above |= alone[corner] & (not height < -planes[plane, 3])
        below |= alone[corner] & (not height > planes[plane, 3])
    return not (above and below)


@njit(cache=True)
def _edge_pierces(corners, i, j, alone):
    """Return whether an edge of face i, with both ends alone, passes through face j."""
    for corner in range(3):
        following = (corner + 1) % 3
        if alone[corner] and alone[following] and _pierces(corners, i, corner, following, j):
            return True
    return False


@njit(cache=True)
def _pierces(corners, i, start, end, j):
    """Return whether an edge passes through a triangle (Möller and Trumbore 1997)."""
    u, v = _apart(corners, j, 0, j, 1), _apart(corners, j, 0, j, 2)
    along, offset = _apart(corners, i, start, i, end), _apart(corners, j, 0, i, start)
    side = cross(along, v)
    volume = dot(u, side)
    if abs(volume) <= SLACK * math.sqrt(dot(u, u) * dot(v, v) * dot(along, along)):
        return False
    lifted = cross(offset, u)
    first, second = dot(offset, side) / volume, dot(along, lifted) / volume
    reach = dot(v, lifted) / volume
    inside = first > SLACK and second > SLACK and first + second < 1 - SLACK
    return inside and SLACK < reach < 1 - SLACK


@njit(cache=True)
def _apart(corners, i, start, j, end):
    """Return the vector from a corner of face i to one of face j."""
    return between(corner_of(corners, i, start), corner_of(corners, j, end))
