"""Lines go on: edges that meet others nearly straight, or a corner, or a rim (mark 3)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import dot, marked, segment_sum, unit
from pns_common.connectivity.topology import EdgeClass
from pns_common.geometry.crease_lines.turns import Edges

# So many times what does not go on is dropped.
ROUNDS = 5
# So many lines that meet are a corner.
CORNER = 3


def go_on(
    points: Float[np.ndarray, "V 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
    at_rim: Bool[np.ndarray, " V"],
    cosine: float,
) -> Bool[np.ndarray, " N"]:
    """Return which edges are left when those are dropped that do not go on at both ends.

    ``at_rim`` says where a line may end.
    """
    ends = mesh.edges[flat]
    along = unit(points[ends[:, 1]] - points[ends[:, 0]])
    left = np.ones(len(flat), dtype=bool)
    for _ in range(ROUNDS):
        at = ends[left].T.reshape(-1)
        count = np.bincount(at, minlength=mesh.vertex_count)
        straight = runs_straight(along[left], at, count, cosine)
        on = at_rim | straight | (count >= CORNER)
        going_on = left & on[ends].all(axis=1)
        if (going_on == left).all():
            break
        left = going_on
    return left


def runs_straight(
    along: Float[np.ndarray, "N 3"],
    at: Int[np.ndarray, " 2*N"],
    count: Int[np.ndarray, " V"],
    cosine: float,
) -> Bool[np.ndarray, " V"]:
    """Return at which vertices just two edges meet, nearly straight.

    ``at`` are the starts of all edges and then their ends, ``count`` how many meet at each vertex.
    """
    # u and v away from there: ‖u + v‖² = 2 + 2 u · v, 0 where they are straight. Two numbers have
    # one sum in either order.
    away = segment_sum(np.concatenate([along, -along]), at, len(count))
    return (count == 2) & (dot(away, away) < 2 - 2 * cosine)


def may_end(mesh: Edges, normals: Float[np.ndarray, "F 3"]) -> Bool[np.ndarray, " V"]:
    """Return where a line may end: at edges that are not interior, and faces without a normal."""
    others = mesh.edges[mesh.edge_class != EdgeClass.INTERIOR]
    without = mesh.faces[dot(normals, normals) == 0]
    return marked(np.concatenate([others.reshape(-1), without.reshape(-1)]), mesh.vertex_count)
