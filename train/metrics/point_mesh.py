"""The distance from points to a triangle mesh: to its triangles, not to its vertices (libigl's).

Of equally near faces libigl names whichever its tree comes to first. On an edge or at a vertex that
decides whose normal counts, so here it is the lowest face that has the nearest point on its border.
"""

from dataclasses import dataclass

import igl
import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import cross, dot
from pns_common.connectivity.topology import build_topology
from pns_common.mesh import Mesh

# Barycentric coordinates up to here are none.
ON_BORDER = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class FaceTree:
    """A mesh's triangles in a tree of boxes.

    Attributes:
        vertices, faces: of the mesh.
        tree: libigl's, of them.
        across: of each face and corner the lowest of the faces on the edge opposite.
        at_vertex: of each vertex its lowest face.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    tree: igl.AABB
    across: Int[np.ndarray, "F 3"]
    at_vertex: Int[np.ndarray, " V"]


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """For each point the distance to the mesh, the nearest point of it, and a face it lies on."""

    distance: Float[np.ndarray, " P"]
    point: Float[np.ndarray, "P 3"]
    face: Int[np.ndarray, " P"]


def face_tree(mesh: Mesh) -> FaceTree:
    """Return the tree of a mesh."""
    vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
    tree = igl.AABB()
    tree.init(vertices, faces)
    corners = np.repeat(np.arange(len(faces)), 3)
    topology = build_topology(faces, len(vertices))
    edges = topology.face_edges.reshape(-1)
    # The edges of a face begin with the one opposite its last corner.
    opposite = np.roll(topology.face_edges, -1, axis=1)
    return FaceTree(
        vertices=vertices,
        faces=faces,
        tree=tree,
        across=_lowest(edges, corners, len(topology.edges))[opposite],
        at_vertex=_lowest(faces.reshape(-1), corners, len(vertices)),
    )


def nearest(tree: FaceTree, points: Float[np.ndarray, "P 3"]) -> Nearest:
    """Return the nearest point of the mesh to each point, in the mesh's unit."""
    answer = tree.tree.squared_distance(tree.vertices, tree.faces, points)
    square, face, point = (np.asarray(part) for part in answer)
    border = _barycentric(tree.vertices[tree.faces[face]], point) <= ON_BORDER
    sides = border.sum(axis=1)
    on_edge = tree.across[face, border.argmax(axis=1)]
    # At a vertex its own coordinate alone is not small.
    at_vertex = tree.at_vertex[tree.faces[face, (~border).argmax(axis=1)]]
    lowest = np.select([sides == 1, sides == 2], [on_edge, at_vertex], face)
    return Nearest(np.sqrt(square), point, lowest)


def distances(tree: FaceTree, points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, " P"]:
    """Return how far each point is from the mesh, in its unit: `nearest` without the rest."""
    square = tree.tree.squared_distance(tree.vertices, tree.faces, points)[0]
    return np.sqrt(np.asarray(square))


def _barycentric(
    corners: Float[np.ndarray, "P 3 3"], points: Float[np.ndarray, "P 3"]
) -> Float[np.ndarray, "P 3"]:
    """Return the coordinates of points in their triangles; 1 where a triangle has no area."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = cross(b - a, c - a)
    square = dot(normal, normal)
    parts = [
        dot(cross(end - start, points - start), normal) for start, end in ((b, c), (c, a), (a, b))
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.stack(parts, axis=1) / square[:, None]
    return np.where(square[:, None] > 0, shares, 1.0)


def _lowest(
    place: Int[np.ndarray, " N"], values: Int[np.ndarray, " N"], count: int
) -> Int[np.ndarray, " K"]:
    """Return the lowest value of each place."""
    lowest = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(lowest, place, values)
    return lowest
