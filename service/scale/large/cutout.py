"""A part with its halo, taken out of the mesh: local numbers that ascend with the mesh's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.base.arrays import marked
from pns_common.connectivity.creases import Creases, pair_keys
from pns_common.pieces import Piece

from .adjacency import Adjacency, ring_of, whole_vertices
from .arrays import ArrayMesh


@dataclass(frozen=True, eq=False)
class Cutout:
    """A piece, and the mesh's numbers of its vertices and faces, both ascending."""

    piece: Piece
    vertices: Int[np.ndarray, " V"]
    faces: Int[np.ndarray, " F"]

    @property
    def is_all(self) -> bool:
        """Whether no halo could be larger."""
        return bool(self.piece.whole.all())


def cutout(mesh: ArrayMesh, adjacency: Adjacency, own: Int[np.ndarray, " N"], rings: int) -> Cutout:
    """Cut out the faces ``own`` (ascending) with so many rings around them."""
    faces = ring_of(mesh, adjacency, own, rings)
    corners = np.asarray(mesh.faces[faces], dtype=np.int64)
    vertices, local = np.unique(corners, return_inverse=True)
    local = local.reshape(-1, 3)
    is_own = marked(np.searchsorted(faces, own), len(faces))
    points = np.asarray(mesh.positions[vertices], dtype=np.float64)
    whole = whole_vertices(adjacency, vertices, local)
    piece = Piece(points, local, is_own, whole, Creases(_local_creases(mesh, vertices, local)))
    return Cutout(piece, vertices, faces)


def _local_creases(
    mesh: ArrayMesh, vertices: Int[np.ndarray, " V"], faces: Int[np.ndarray, "F 3"]
) -> Int[np.ndarray, "N 2"] | None:
    """Return the creases that are edges of the piece, in its numbers."""
    if mesh.creases is None:
        return None
    creases = np.asarray(mesh.creases, dtype=np.int64)
    place = np.minimum(np.searchsorted(vertices, creases), len(vertices) - 1)
    local = place[(vertices[place] == creases).all(axis=1)]
    count, sides = len(vertices), faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return local[np.isin(pair_keys(local, count), pair_keys(sides, count))]
