"""The distance from points to a triangle mesh: to its triangles, not to its vertices.

Triangles lie in a binary tree of axis-aligned boxes. All points go down the tree at once, level by
level, and leave out the boxes that are farther than a triangle already seen: none of them can hold
the nearest one, so that the result is exact but for rounding.

libigl's tree finds the same distances, to 1e-15 of them, in a quarter of the time. Of equally near
faces it names whichever it comes to first, here it is the lowest: on an edge that decides whose
normal counts, and improvements of mean normal errors differed by up to 0.4 points.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from pns_common.arrays import cross, dot
from pns_common.mesh import Mesh

LEAF = 4
"""Triangles in a box of the last level."""

SEARCHED = 1000
"""Points whose distance is found at once where only the largest is wanted."""

BLOCK = 16_384
"""Points that go down the tree together: their boxes stay in the processor's cache."""


@dataclass(frozen=True, eq=False, slots=True)
class BoxTree:
    """Triangles in nested boxes.

    Attributes:
        corners: of each triangle.
        centroids: tree of their centroids, for a first guess.
        order: the triangles of box i of the last level are `order[LEAF i … LEAF (i + 1) − 1]`; some
            come twice, to fill the last box.
        lower, upper: of each level, from the root down, its boxes; box i of a level holds boxes
            2 i and 2 i + 1 of the next.
    """

    corners: Float[np.ndarray, "F 3 3"]
    centroids: KDTree
    order: Int[np.ndarray, " N"]
    lower: tuple[Float[np.ndarray, "B 3"], ...]
    upper: tuple[Float[np.ndarray, "B 3"], ...]


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """For each point the distance to the mesh and a face that is this near."""

    distance: Float[np.ndarray, " P"]
    face: Int[np.ndarray, " P"]


def box_tree(mesh: Mesh) -> BoxTree:
    """Return the tree of a mesh: each box is halved at the median along its longest side."""
    corners = mesh.vertices[mesh.faces]
    count = len(corners)
    depth = max(0, int(np.ceil(np.log2(count / LEAF))))
    order = np.resize(np.arange(count), LEAF * 2**depth)
    middle = corners.mean(axis=1)
    for level in range(depth):
        boxes = order.reshape(2**level, -1)
        points = middle[boxes]
        axis = np.ptp(points, axis=1).argmax(axis=-1)
        along = np.take_along_axis(points, axis[:, None, None], axis=2)[..., 0]
        sorting = np.argsort(along, axis=1, kind="stable")
        order = np.take_along_axis(boxes, sorting, axis=1).reshape(-1)
    leaves = corners[order].reshape(-1, LEAF * 3, 3)
    lower, upper = [leaves.min(axis=1)], [leaves.max(axis=1)]
    for _ in range(depth):
        lower.append(np.minimum(lower[-1][0::2], lower[-1][1::2]))
        upper.append(np.maximum(upper[-1][0::2], upper[-1][1::2]))
    return BoxTree(
        corners=corners,
        centroids=KDTree(middle),
        order=order,
        lower=tuple(lower[::-1]),
        upper=tuple(upper[::-1]),
    )


def nearest(tree: BoxTree, points: Float[np.ndarray, "P 3"]) -> Nearest:
    """Return the distance from each point to the mesh, in the mesh's unit."""
    blocks = [_nearest(tree, points[i : i + BLOCK]) for i in range(0, len(points), BLOCK)]
    return Nearest(
        distance=np.concatenate([block.distance for block in blocks]),
        face=np.concatenate([block.face for block in blocks]),
    )


def _first_guess(
    tree: BoxTree, points: Float[np.ndarray, "P 3"]
) -> tuple[Float[np.ndarray, " P"], Int[np.ndarray, " P"]]:
    """Return the squared distance to the triangle whose centroid is nearest, and that triangle."""
    _, face = tree.centroids.query(points)
    return squared_distance(points, tree.corners[face]), face


def farthest(tree: BoxTree, points: Float[np.ndarray, "P 3"], least: float) -> float:
    """Return the largest distance of any point from the mesh, or `least` if that is larger.

    Most points are passed over: some triangle is nearer than the largest distance found so far.
    """
    bound = np.sqrt(_first_guess(tree, points)[0])
    order = np.argsort(-bound)
    for start in range(0, len(order), SEARCHED):
        rows = order[start : start + SEARCHED]
        rows = rows[bound[rows] > least]
        if len(rows) == 0:
            break
        least = max(least, float(nearest(tree, points[rows]).distance.max()))
    return least


def squared_distance(
    points: Float[np.ndarray, "N 3"], corners: Float[np.ndarray, "N 3 3"]
) -> Float[np.ndarray, " N"]:
    """Return the squared distance of each point to its triangle, which may have no area.

    The nearest point of a triangle is the foot on its plane, where that is inside, else it is on
    a side.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = cross(b - a, c - a)
    area2 = dot(normal, normal)
    height = dot(points - a, normal)
    above = height * height / np.where(area2 > 0, area2, 1)
    inside, least = area2 > 0, np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        side, from_start = end - start, points - start
        length2 = dot(side, side)
        along = dot(from_start, side) / np.where(length2 > 0, length2, 1)
        off = from_start - np.clip(along, 0, 1)[:, None] * side
        least = np.minimum(least, dot(off, off))
        # Inside where the foot lies to the left of all three sides.
        inside &= dot(cross(side, from_start), normal) >= 0
    return np.where(inside, np.minimum(above, least), least)


def _nearest(tree: BoxTree, points: Float[np.ndarray, "P 3"]) -> Nearest:
    best, face = _first_guess(tree, points)
    # A box whose distance is rounded up must not be left out.
    bound = best * (1 + 1e-12)
    row, box = np.arange(len(points)), np.zeros(len(points), dtype=np.int64)
    for level in range(1, len(tree.lower)):
        row, box = np.repeat(row, 2), np.repeat(2 * box, 2)
        box[1::2] += 1
        within = _box_distance2(tree, level, box, points[row]) <= bound[row]
        row, box = row[within], box[within]
    pairs = np.repeat(row, LEAF)
    triangle = tree.order[(LEAF * box[:, None] + np.arange(LEAF)).reshape(-1)]
    distance2 = squared_distance(points[pairs], tree.corners[triangle])
    # Of each point's pairs, which stand together, the nearest; of equal ones the lowest face.
    order = np.lexsort((triangle, distance2, pairs))
    first = order[np.searchsorted(pairs[order], np.arange(len(points)))]
    better = distance2[first] <= best
    return Nearest(
        distance=np.sqrt(np.where(better, distance2[first], best)),
        face=np.where(better, triangle[first], face),
    )


def _box_distance2(
    tree: BoxTree,
    level: int,
    box: Int[np.ndarray, " N"],
    points: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, " N"]:
    outside = np.maximum(tree.lower[level][box] - points, points - tree.upper[level][box])
    np.maximum(outside, 0, out=outside)
    return dot(outside, outside)
