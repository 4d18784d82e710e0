"""The prior of a boundary: pushes that undo what Loop's curve rule cuts off it.

A boundary becomes a cubic B-spline, which runs inside the bends of its polygon: the limit of a
vertex p between a and b is p + (a + b − 2 p) / 6. Pushing p the other way, across the curve,

    d_p = −b γ_p (u − (u · t) t) / 3       u = (a + b) / 2 − p, t the direction from a to b

is quasi-interpolation of the curve. γ_p = tanh(c_v x_p) f(x_p), x_p = 1 − cos of the turning angle
at p: 0 where the boundary is straight, and 0 at corners of a right angle or more, which are meant.

Nothing here knows the surface: two pieces with the same boundary push it alike and meet again, if
they share R. (The fold guard leaves boundaries alone; only where a boundary's own displacement
would fold a face of one piece, and what lies inside does not go along, do they differ.)
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import Array, dot, gather, namespace, scatter, unit
from pns_common.connectivity.topology import EdgeClass, Topology, sharp_edge_count

# f falls from 1 where a boundary turns by 60 degrees to 0 at 90.
BEND, CORNER = 1 / 2, 1.0


def boundary_vertices(topology: Topology) -> Bool[np.ndarray, " V"]:
    """Return the vertices on exactly two boundary edges, and on no other edge that is sharp."""
    boundary = topology.edges[topology.edge_class == EdgeClass.BOUNDARY]
    count = np.bincount(boundary.reshape(-1), minlength=topology.vertex_count)
    return (count == 2) & (sharp_edge_count(topology) == 2)


def on_boundary(topology: Topology) -> Bool[np.ndarray, " N"]:
    """Return which vertices of the split of a mesh its boundaries alone place."""
    is_boundary = topology.edge_class == EdgeClass.BOUNDARY
    return np.concatenate([boundary_vertices(topology), is_boundary])


def along_boundary(topology: Topology, vertices: Int[np.ndarray, " N"]) -> Int[np.ndarray, "N 2"]:
    """Return the two neighbours of boundary vertices along the boundary."""
    boundary = topology.edges[topology.edge_class == EdgeClass.BOUNDARY]
    ends, others = boundary.reshape(-1), boundary[:, ::-1].reshape(-1)
    wanted = np.zeros(topology.vertex_count, dtype=bool)
    wanted[vertices] = True
    spokes = np.flatnonzero(wanted[ends])
    order = spokes[np.argsort(ends[spokes], kind="stable")]
    return others[order].reshape(-1, 2)


def boundary_pushes(
    points: Float[Array, "V 3"], topology: Topology, gate_sharpness: float
) -> Float[Array, "V 3"]:
    """Return d of all vertices at b = 1; ``gate_sharpness`` is c_v."""
    xp = namespace(points)
    vertices = np.flatnonzero(boundary_vertices(topology))
    sides = along_boundary(topology, vertices)
    middle = gather(points, vertices)
    a, b = (gather(points, sides[:, side]) - middle for side in (0, 1))
    turning = 1 + dot(unit(a), unit(b))
    fade = (CORNER - turning) / (CORNER - BEND)
    gate = xp.tanh(gate_sharpness * turning) * xp.clip(fade, 0.0, 1.0)
    umbrella, along = (a + b) / 2, unit(b - a)
    across = umbrella - dot(umbrella, along)[:, None] * along
    pushes = -(gate / 3)[:, None] * across
    return scatter(pushes, vertices, points.shape[0])


def boundary_square(
    points: Float[Array, "V 3"], topology: Topology, vertices: Int[np.ndarray, " N"]
) -> Float[Array, " N"]:
    """Return h² of boundary vertices: the mean square of their two boundary edges."""
    sides, middle = along_boundary(topology, vertices), gather(points, vertices)
    a, b = (gather(points, sides[:, side]) - middle for side in (0, 1))
    return (dot(a, a) + dot(b, b)) / 2
