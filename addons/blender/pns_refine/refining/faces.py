"""The faces of a refined mesh: triangles, or the quads that pairs of them make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.topology import Topology

from .snapshot import Faces, Snapshot

# Of a child's three sides, the one parallel to its parent's side d is (d + turn) mod 3.
SIDE_TURN = np.array([0, 2, 1, 1])


@dataclass(frozen=True, eq=False)
class FacePlan:
    """The faces, and for each of their corners the triangles' corner 3 t + i it stands on."""

    faces: Faces
    corner: Int[np.ndarray, " C"] | slice


def triangle_faces(final: Topology, parents: Int[np.ndarray, " T"]) -> FacePlan:
    """Return all triangles as they are; ``parents`` are the polygons they come from."""
    count = len(final.faces)
    faces = Faces(
        starts=3 * np.arange(count + 1),
        vertices=final.corners.astype(np.int64),
        edges=final.corner_edges.astype(np.int64),
        parents=parents,
    )
    return FacePlan(faces, slice(None))


def quad_faces(
    final: Topology, parents: Int[np.ndarray, " T"], diagonal: Int[np.ndarray, " T"]
) -> FacePlan:
    """Join triangles across ``diagonal``, the side that they share with another of their quad.

    A quad was cut along a diagonal, and each piece has one side parallel to it at every level: so
    the pieces pair up without a rest. −1 is a triangle that stays one. A quad stands where its
    first triangle did.
    """
    triangles = np.arange(len(diagonal))
    joined = np.flatnonzero(diagonal >= 0)
    sides = final.face_edges.astype(np.int64)
    edge = sides[joined, diagonal[joined]]
    key = edge * (int(parents.max(initial=0)) + 1) + parents[joined]
    order = np.argsort(key, kind="stable")
    key, joined = key[order], joined[order]
    starts = np.flatnonzero(np.r_[True, key[1:] != key[:-1]]) if len(key) else np.empty(0, int)
    pair = starts[np.diff(starts, append=len(key)) == 2]
    first, second = joined[pair], joined[pair + 1]
    # They must run along the diagonal in opposite directions.
    begins = final.faces[first, diagonal[first]]
    ends = final.faces[second, (diagonal[second] + 1) % 3]
    first, second = first[begins == ends], second[begins == ends]

    partner = np.full(len(diagonal), -1, dtype=np.int64)
    partner[first] = second
    stays = np.ones(len(diagonal), dtype=bool)
    stays[second] = False
    kept = triangles[stays]
    quad = partner[kept] >= 0
    size = np.where(quad, 4, 3)
    starts = np.concatenate([[0], np.cumsum(size)])
    corner = np.empty(starts[-1], dtype=np.int64)
    # From the diagonal's end over the opposite corner to its beginning, then the other's corner.
    turn = np.where(quad, diagonal[kept] + 1, 0)
    for place in range(3):
        corner[starts[:-1] + place] = 3 * kept + (turn + place) % 3
    other = partner[kept[quad]]
    corner[starts[:-1][quad] + 3] = 3 * other + (diagonal[other] + 2) % 3
    edges = sides.reshape(-1)[corner]
    # The third side of the first triangle is the diagonal: a quad goes on along the second's.
    edges[starts[:-1][quad] + 2] = sides[other, (diagonal[other] + 1) % 3]
    vertices = final.corners.astype(np.int64)[corner]
    return FacePlan(Faces(starts, vertices, edges, parents[kept]), corner)


def quad_diagonals(snapshot: Snapshot) -> Int[np.ndarray, " T"]:
    """Return each triangle's side that its quad was cut along; −1 where it is no half of one."""
    start = snapshot.polygon_corners[snapshot.polygons]
    size = snapshot.polygon_corners[snapshot.polygons + 1] - start
    place = snapshot.corners - start[:, None]
    follows = (place + 1) % size[:, None] == np.roll(place, -1, axis=1)
    cut = (size == 4) & (follows.sum(axis=1) == 2)
    return np.where(cut, np.argmin(follows, axis=1), -1)


def diagonal_children(diagonal: Int[np.ndarray, " T"], levels: int) -> Int[np.ndarray, " C"]:
    """Return the sides of the triangles' children that are parallel to these."""
    for _ in range(levels):
        turned = (diagonal[:, None] + SIDE_TURN) % 3
        diagonal = np.where(diagonal[:, None] < 0, -1, turned).reshape(-1)
    return diagonal


def used_edges(faces: Faces, edge_count: int) -> np.ndarray:
    """Return whether a face has the edge: diagonals of joined quads are in none."""
    used = np.zeros(edge_count, dtype=bool)
    used[faces.edges] = True
    return used
