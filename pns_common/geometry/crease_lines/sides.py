"""Which sharp edges lie between two sides of a part (mark 2)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import marked
from pns_common.geometry.crease_lines.turns import Edges, clearly_half, turn_cosines


def between_sides(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, sharp: Int[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return at which of all sharp edges two sides of a part meet.

    Both of its faces are flat beside it; or one is, and the other is a side by itself.
    """
    faces = mesh.half_edges[sharp] // 3
    first, second = are_flat(normals, mesh, faces, sharp[:, None]).T
    between = first & second
    rows = np.flatnonzero(first != second)
    others = faces[rows, first[rows].astype(np.intp)]
    between[rows] = are_sides(normals, mesh, others, marked(sharp, len(mesh.edges)))
    return between


def are_flat(
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    faces: Int[np.ndarray, "..."],
    edges: Int[np.ndarray, "..."],
) -> Bool[np.ndarray, "..."]:
    """Return which faces are flat beside an edge: another of theirs turns less than half as much.

    An edge that is not interior turns by nothing, nor does one of a face without area.
    """
    theirs = mesh.face_edges[faces]
    cosines = turn_cosines(normals, mesh, theirs)
    cosines[theirs == edges[..., None]] = -1.0
    return cosines.max(axis=-1) > clearly_half(turn_cosines(normals, mesh, edges))


def are_sides(
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    faces: Int[np.ndarray, " N"],
    is_sharp: Bool[np.ndarray, " E"],
) -> Bool[np.ndarray, " N"]:
    """Return which faces are sides by themselves, as a wedge's end and a gable are.

    All edges of such a triangle are sharp, and across each is a face that is flat beside it.
    """
    rows = np.flatnonzero(is_sharp[mesh.face_edges[faces]].all(axis=1))
    own, edges = faces[rows, None], mesh.face_edges[faces[rows]]
    beside = mesh.half_edges[edges] // 3
    across = np.where(beside[..., 0] == own, beside[..., 1], beside[..., 0])
    sides = np.zeros(len(faces), dtype=bool)
    sides[rows] = are_flat(normals, mesh, across, edges).all(axis=1)
    return sides
