"""The distance from points to a triangle mesh: to its triangles, not to its vertices.

Of equally near faces the lowest is named. On an edge or at a vertex, where rounding would decide
which are equally near, it is the lowest face that has the nearest point on its border.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.fused.levels.mesh_edges import build_edges
from train.metrics.faces import face_boxes
from train.metrics.faces.face_boxes import FaceBoxes
from train.metrics.faces.nearest_face import search
from train.vectors import dot

# Barycentric coordinates up to here are none.
ON_BORDER = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class FaceTree:
    """A mesh's triangles in a tree of boxes, and who is whose neighbour.

    Attributes:
        across: of each face and corner the lowest of the faces on the edge opposite.
        at_vertex: of each vertex its lowest face.
    """

    boxes: FaceBoxes
    across: Int[np.ndarray, "F 3"]
    at_vertex: Int[np.ndarray, " V"]

    @property
    def vertices(self) -> Float[np.ndarray, "V 3"]:
        """Of the mesh."""
        return self.boxes.vertices

    @property
    def faces(self) -> Int[np.ndarray, "F 3"]:
        """Of the mesh."""
        return self.boxes.faces


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """For each point the distance to the mesh, the nearest point of it, and a face it lies on."""

    distance: Float[np.ndarray, " P"]
    point: Float[np.ndarray, "P 3"]
    face: Int[np.ndarray, " P"]


def face_tree(mesh: Mesh) -> FaceTree:
    """Return the tree of a mesh."""
    boxes = face_boxes.face_boxes(mesh)
    count = len(mesh.vertices)
    edges = build_edges(boxes.faces.astype(np.int32), count, Blocks(1))
    # The first half-edge of an edge is in its lowest face.
    lowest = edges.half_edges[:, 0].astype(np.int64) // 3
    # The edges of a face begin with the one opposite its last corner.
    opposite = np.roll(edges.face_edges, -1, axis=1)
    at_vertex = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(at_vertex, boxes.faces, np.arange(len(boxes.faces))[:, None])
    return FaceTree(boxes, lowest[opposite], at_vertex)


def moved(tree: FaceTree, vertices: Float[np.ndarray, "V 3"]) -> FaceTree:
    """Return the tree of the same faces with vertices elsewhere: good where that is not far."""
    return replace(tree, boxes=face_boxes.moved(tree.boxes, vertices))


def nearest(tree: FaceTree, points: Float[np.ndarray, "P 3"]) -> Nearest:
    """Return the nearest point of the mesh to each point, in the mesh's unit."""
    square, face, point = _searched(tree.boxes, points)
    border = _barycentric(tree.vertices[tree.faces[face]], point) <= ON_BORDER
    sides = border.sum(axis=1)
    on_edge = tree.across[face, border.argmax(axis=1)]
    # At a vertex its own coordinate alone is not small.
    at_vertex = tree.at_vertex[tree.faces[face, (~border).argmax(axis=1)]]
    lowest = np.select([sides == 1, sides == 2], [on_edge, at_vertex], face)
    return Nearest(np.sqrt(square), point, lowest)


def distances(tree: FaceTree, points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, " P"]:
    """Return how far each point is from the mesh, in its unit: `nearest` without the rest."""
    return np.sqrt(_searched(tree.boxes, points)[0])


def _barycentric(
    corners: Float[np.ndarray, "P 3 3"], points: Float[np.ndarray, "P 3"]
) -> Float[np.ndarray, "P 3"]:
    """Return the coordinates of points in their triangles; 1 where a triangle has no area."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    square = dot(normal, normal)
    parts = [
        dot(np.cross(end - start, points - start), normal)
        for start, end in ((b, c), (c, a), (a, b))
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.stack(parts, axis=1) / square[:, None]
    return np.where(square[:, None] > 0, shares, 1.0)


def _searched(
    tree: FaceBoxes, points: Float[np.ndarray, "P 3"]
) -> tuple[Float[np.ndarray, " P"], Int[np.ndarray, " P"], Float[np.ndarray, "P 3"]]:
    """Return for each point the squared distance, the face, and the point of it."""
    square, place = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    on_mesh = np.empty((len(points), 3))
    search(
        tree.order,
        tree.corners,
        tree.boxes,
        tree.last_level,
        np.ascontiguousarray(points, dtype=np.float64),
        square,
        place,
        on_mesh,
    )
    return square, tree.order[place], on_mesh
