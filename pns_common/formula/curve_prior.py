"""The prior of curves: pushes that undo what Loop's curve rule cuts off boundaries and creases.

A boundary becomes a cubic B-spline, and so does a line of creases. It runs inside the bends of its
polygon: the limit of a vertex p between a and b is p + (a + b − 2 p) / 6. Pushing p the other way,
across the curve,

    d_p = −b γ_p (u − (u · t) t) / 3       u = (a + b) / 2 − p, t the direction from a to b

is quasi-interpolation of the curve. γ_p = tanh(c_v x_p) f(x_p), x_p = 1 − cos of the turning angle
at p: 0 where the curve is straight, and 0 at corners of a right angle or more, which are meant.

Nothing here knows the surface: two pieces with the same boundary push it alike and meet again, if
they share R. (The fold guard leaves boundaries alone; only where a boundary's own displacement
would fold a face of one piece, and what lies inside does not go along, do they differ.)
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import Array, dot, gather, namespace, scatter, unit
from pns_common.connectivity.topology import EdgeClass, Topology, sharp_edge_count

# f falls from 1 where a curve turns by 60 degrees to 0 at 90.
BEND, CORNER = 1 / 2, 1.0
# The edges that a curve may be made of.
Kinds = tuple[EdgeClass, ...]
BOUNDARIES: Kinds = (EdgeClass.BOUNDARY,)
BOUNDARIES_AND_CREASES: Kinds = (EdgeClass.BOUNDARY, EdgeClass.CREASE)


def curve_vertices(topology: Topology, kinds: Kinds) -> Bool[np.ndarray, " V"]:
    """Return the vertices on exactly two edges of these kinds, and on no other sharp edge."""
    edges = topology.edges[curve_edges(topology, kinds)]
    count = np.bincount(edges.reshape(-1), minlength=topology.vertex_count)
    return (count == 2) & (sharp_edge_count(topology) == 2)


def curve_edges(topology: Topology, kinds: Kinds) -> Int[np.ndarray, " N"]:
    """Return the edges of these kinds."""
    return np.flatnonzero(are_of(kinds, topology.edge_class))


def are_of(kinds: Kinds, edge_class: Int[np.ndarray, " E"]) -> Bool[np.ndarray, " E"]:
    """Return which edges are of these kinds; numpy's search takes as long as all else on a box."""
    found = np.zeros(len(edge_class), dtype=bool)
    for kind in kinds:
        # An enumeration's member would be compared in 64 bits.
        found |= edge_class == int(kind)
    return found


def on_boundary(topology: Topology) -> Bool[np.ndarray, " N"]:
    """Return which vertices of the split of a mesh its boundaries alone place."""
    is_boundary = topology.edge_class == EdgeClass.BOUNDARY
    return np.concatenate([curve_vertices(topology, BOUNDARIES), is_boundary])


def along_curves(
    topology: Topology, vertices: Int[np.ndarray, " N"], kinds: Kinds
) -> Int[np.ndarray, "N 2"]:
    """Return the two neighbours of curves' vertices along them."""
    edges = topology.edges[curve_edges(topology, kinds)]
    ends, others = edges.reshape(-1), edges[:, ::-1].reshape(-1)
    wanted = np.zeros(topology.vertex_count, dtype=bool)
    wanted[vertices] = True
    spokes = np.flatnonzero(wanted[ends])
    order = spokes[np.argsort(ends[spokes], kind="stable")]
    return others[order].reshape(-1, 2)


def curve_spokes(
    points: Float[Array, "V 3"], topology: Topology, vertices: Int[np.ndarray, " N"], kinds: Kinds
) -> tuple[Float[Array, "N 3"], Float[Array, "N 3"]]:
    """Return a − p and b − p of curves' vertices."""
    sides, middle = along_curves(topology, vertices, kinds), gather(points, vertices)
    a, b = (gather(points, sides[:, side]) - middle for side in (0, 1))
    return a, b


def across(vectors: Float[Array, "N 3"], along: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return the part of vectors that is at right angles to unit vectors."""
    return vectors - dot(vectors, along)[:, None] * along


def curve_pushes(
    points: Float[Array, "V 3"], topology: Topology, gate_sharpness: float, kinds: Kinds
) -> Float[Array, "V 3"]:
    """Return d of all vertices at b = 1; ``gate_sharpness`` is c_v."""
    xp = namespace(points)
    vertices = np.flatnonzero(curve_vertices(topology, kinds))
    a, b = curve_spokes(points, topology, vertices, kinds)
    turning = 1 + dot(unit(a), unit(b))
    fade = (CORNER - turning) / (CORNER - BEND)
    gate = xp.tanh(gate_sharpness * turning) * xp.clip(fade, 0.0, 1.0)
    pushes = -(gate / 3)[:, None] * across((a + b) / 2, unit(b - a))
    return scatter(pushes, vertices, points.shape[0])
