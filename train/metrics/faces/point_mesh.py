"""The distance from points to a triangle mesh: to its triangles, not to its vertices (libigl)."""

from dataclasses import dataclass

import igl
import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh


@dataclass(frozen=True, eq=False, slots=True)
class FaceTree:
    """A mesh's triangles in a tree of boxes."""

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    boxes: igl.AABB


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """For each point the distance to the mesh, the nearest point of it, and a face it lies on."""

    distance: Float[np.ndarray, " P"]
    point: Float[np.ndarray, "P 3"]
    face: Int[np.ndarray, " P"]


def face_tree(mesh: Mesh) -> FaceTree:
    """Return the tree of a mesh."""
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    boxes = igl.AABB()
    boxes.init(vertices, faces)
    return FaceTree(vertices, faces, boxes)


def nearest(tree: FaceTree, points: Float[np.ndarray, "P 3"]) -> Nearest:
    """Return the nearest point of the mesh to each point, in the mesh's unit.

    On an edge or at a vertex the face is one of those that meet there.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    square, face, point = tree.boxes.squared_distance(tree.vertices, tree.faces, points)
    return Nearest(np.sqrt(square), np.asarray(point), np.asarray(face))
