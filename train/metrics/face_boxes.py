"""A mesh's faces in a tree of boxes: what is near is found without a look at all of them.

A node is `WIDE` boxes. Those of a node of the last level are faces'; another node n's are those of
its children `WIDE * n + 1` … `WIDE * n + WIDE`. What there is no face for has an empty box.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit

from pns_common import Mesh

# Eight float64 fill the widest register.
WIDE = 8

# Columns of a box: its least coordinates, its largest.
LOWER, UPPER = 0, 3

# Nodes that wait at once while a tree is searched: fewer than `WIDE` a level, of 2⁶³ faces at most.
MOST_WAITING = 256


@dataclass(frozen=True, eq=False, slots=True)
class FaceBoxes:
    """The tree of a mesh.

    Attributes:
        vertices, faces: of the mesh.
        order: the faces as the tree has them.
        corners: of each face in this order.
        boxes: of each node.
        last_level: its first node.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    order: Int[np.ndarray, " F"]
    corners: Float[np.ndarray, "F 3 3"]
    boxes: Float[np.ndarray, "N 6 W"]
    last_level: int


def face_boxes(mesh: Mesh) -> FaceBoxes:
    """Return the tree of a mesh."""
    vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
    order = _halved(vertices[faces].mean(axis=1))
    last_level, width = 0, 1
    while width * WIDE < len(faces):
        last_level, width = last_level + width, width * WIDE
    boxes = np.empty((last_level - (-len(faces) // WIDE), 6, WIDE))
    corners = np.empty((len(faces), 3, 3))
    _fill(vertices, faces, order, last_level, corners, boxes)
    return FaceBoxes(vertices, faces, order, corners, boxes, last_level)


@njit(cache=True)
def _halved(centres):
    """Return an order of points: whatever power of two it is cut into, pieces are compact.

    Each piece is halved across its longest side (a median by quickselect, Hoare 1961).
    """
    order = np.arange(len(centres))
    pieces = [(0, len(order))]
    while pieces:
        begin, end = pieces.pop()
        middle, axis = begin + 1, _longest_side(centres, order, begin, end)
        while 2 * (middle - begin) < end - begin:
            middle += middle - begin
        low, high = begin, end - 1
        while low < high:
            pivot = centres[order[(low + high) // 2], axis]
            i, j = low, high
            while i <= j:
                while centres[order[i], axis] < pivot:
                    i += 1
                while centres[order[j], axis] > pivot:
                    j -= 1
                if i <= j:
                    order[i], order[j] = order[j], order[i]
                    i, j = i + 1, j - 1
            if middle <= j:
                high = j
            elif middle >= i:
                low = i
            else:
                break
        if middle - begin > 1:
            pieces.append((begin, middle))
        if end - middle > 1:
            pieces.append((middle, end))
    return order


@njit(cache=True)
def _longest_side(centres, order, begin, end):
    axis, longest = 0, -1.0
    for k in range(3):
        low = high = centres[order[begin], k]
        for place in range(begin, end):
            value = centres[order[place], k]
            low, high = min(low, value), max(high, value)
        if high - low > longest:
            axis, longest = k, high - low
    return axis


@njit(cache=True)
def _fill(vertices, faces, order, last_level, corners, boxes):
    boxes[:, LOWER:UPPER], boxes[:, UPPER:] = np.inf, -np.inf
    for place in range(len(order)):
        node, lane = last_level + place // WIDE, place % WIDE
        for corner in range(3):
            for k in range(3):
                value = vertices[faces[order[place], corner], k]
                corners[place, corner, k] = value
                boxes[node, LOWER + k, lane] = min(boxes[node, LOWER + k, lane], value)
                boxes[node, UPPER + k, lane] = max(boxes[node, UPPER + k, lane], value)
    for node in range(len(boxes) - 1, 0, -1):
        parent, lane = (node - 1) // WIDE, (node - 1) % WIDE
        for k in range(3):
            boxes[parent, LOWER + k, lane] = boxes[node, LOWER + k].min()
            boxes[parent, UPPER + k, lane] = boxes[node, UPPER + k].max()


@njit
def dot(u, v):
    """Return the inner product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@njit
def cross(u, v):
    """Return the cross product."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@njit
def corner_of(corners, face, corner):
    """Return one of a face's three points."""
    return corners[face, corner, 0], corners[face, corner, 1], corners[face, corner, 2]


@njit
def between(p, q):
    """Return the vector from p to q."""
    return q[0] - p[0], q[1] - p[1], q[2] - p[2]
