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

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import Array, dot, gather, namespace, norm, scatter, unit
from pns_common.connectivity.topology import EdgeClass, Topology, sharp_edge_count
from pns_common.geometry.ring_sums import divided
from pns_common.masks.stencils import CURVE_CENTRE, CURVE_NEIGHBOUR

# f falls from 1 where a curve turns by 60 degrees to 0 at 90.
BEND, CORNER = 1 / 2, 1.0
# Of the way along a curve, its chord across a vertex; below that a curve's direction fades.
CLEAR_CHORD = 1 / 4
# The edges that a curve may be made of.
Kinds = tuple[EdgeClass, ...]
BOUNDARIES: Kinds = (EdgeClass.BOUNDARY,)
BOUNDARIES_AND_CREASES: Kinds = (EdgeClass.BOUNDARY, EdgeClass.CREASE)


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of a level's edges of some kinds.

    Attributes:
        movable: of all vertices those on exactly two such edges, and on no other that is sharp.
        edges: those that end at a movable vertex; what happens at others does not change them.
        rows: the numbers of the movable vertices.
        sides: of each of these its two neighbours along the curve.
        a, b: from it to these.
    """

    movable: Bool[np.ndarray, " V"]
    edges: Int[np.ndarray, " M"]
    rows: Int[np.ndarray, " N"]
    sides: Int[np.ndarray, "N 2"]
    a: Float[Array, "N 3"]
    b: Float[Array, "N 3"]


def find_curves(points: Float[Array, "V 3"], topology: Topology, kinds: Kinds) -> Curves:
    """Return the curves of a level."""
    edges = np.flatnonzero(are_of(kinds, topology.edge_class))
    movable = _between_two(topology, topology.edges[edges])
    rows, ends = np.flatnonzero(movable), topology.edges[edges]
    edges = edges[movable[ends[:, 0]] | movable[ends[:, 1]]]
    sides, middle = _along(topology.edges[edges], movable), gather(points, rows)
    a, b = (gather(points, sides[:, side]) - middle for side in (0, 1))
    return Curves(movable, edges, rows, sides, a, b)


def are_of(kinds: Kinds, edge_class: Int[np.ndarray, " E"]) -> Bool[np.ndarray, " E"]:
    """Return which edges are of these kinds; numpy's search takes as long as all else on a box."""
    found = np.zeros(len(edge_class), dtype=bool)
    for kind in kinds:
        # An enumeration's member would be compared in 64 bits.
        found |= edge_class == int(kind)
    return found


def on_boundary(topology: Topology) -> Bool[np.ndarray, " N"]:
    """Return which vertices of the split of a mesh its boundaries alone place."""
    is_boundary = are_of(BOUNDARIES, topology.edge_class)
    return np.concatenate([_between_two(topology, topology.edges[is_boundary]), is_boundary])


def across(vectors: Float[Array, "N 3"], along: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return the part of vectors that is at right angles to unit vectors."""
    return vectors - dot(vectors, along)[:, None] * along


def curve_direction(a: Float[Array, "N 3"], b: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return the direction from a to b: of length 1, less where the curve turns back on itself.

    There it is 0, and it stays Lipschitz: turns of up to 150 degrees have length 1.
    """
    chord, clear = norm(b - a), (norm(a) + norm(b)) * CLEAR_CHORD
    longer = namespace(a).where(chord > clear, chord, clear)[:, None]
    return divided(b - a, longer)


def curve_gate(turning: Float[Array, " N"], gate_sharpness: float) -> Float[Array, " N"]:
    """Return γ from x of a curve's vertices; ``gate_sharpness`` is c_v."""
    xp = namespace(turning)
    fade = (CORNER - turning) / (CORNER - BEND)
    return xp.tanh(gate_sharpness * turning) * xp.clip(fade, 0.0, 1.0)


def curve_pushes(curves: Curves, gate_sharpness: float) -> Float[Array, "V 3"]:
    """Return d of all vertices at b = 1; ``gate_sharpness`` is c_v."""
    a, b = curves.a, curves.b
    gate = curve_gate(1 + dot(unit(a), unit(b)), gate_sharpness)
    pushes = -(gate / 3)[:, None] * across((a + b) / 2, unit(b - a))
    return scatter(pushes, curves.rows, len(curves.movable))


def curve_mask(curves: Curves, values: Float[Array, "V K"]) -> Float[Array, "N K"]:
    """Return what Loop's curve rule makes of vertices' values, at the movable ones."""
    around = gather(values, curves.sides[:, 0]) + gather(values, curves.sides[:, 1])
    return CURVE_CENTRE * gather(values, curves.rows) + CURVE_NEIGHBOUR * around


def _between_two(topology: Topology, edges: Int[np.ndarray, "M 2"]) -> Bool[np.ndarray, " V"]:
    """Return the vertices on exactly two of some edges, and on no other edge that is sharp."""
    count = np.bincount(edges.reshape(-1), minlength=topology.vertex_count)
    return (count == 2) & (sharp_edge_count(topology) == 2)


def _along(
    edges: Int[np.ndarray, "M 2"], movable: Bool[np.ndarray, " V"]
) -> Int[np.ndarray, "N 2"]:
    """Return the two neighbours of movable vertices along the edges, the first edge's first."""
    ends, others = edges.reshape(-1), edges[:, ::-1].reshape(-1)
    sides = np.empty((len(movable), 2), dtype=edges.dtype)
    # Of a vertex that is named twice the last one stays.
    sides[ends[::-1], 0] = others[::-1]
    sides[ends, 1] = others
    return sides[movable]
