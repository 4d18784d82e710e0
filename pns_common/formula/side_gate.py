"""A gate that reads the sides of an edge's two faces: it is open on the diagonal of a plane quad.

    γ = γ₂ + (1 − γ₂) w,   w = tanh(c_v min(b_1, b_2)),   b_i = mean of x f(x) over face i's edges

γ₂ is the gate of an edge's own two faces, which is shut where they lie in one plane. That is right
on the flat sides of a part with sharp edges. But the two halves of a plane quad lie in one plane on
any surface, and moving all edges but the diagonals shows as ripples. So an edge is also corrected
where both its faces bend gently across some edge: x is 1 − n · n' there, and f falls from 1 to 0
over GENTLE_TO_SHARP. A right angle has x = 1 and does not count: on a box all sides stay shut, on a
prism of many sides the walls are open, however few rows they have, and its lids are not. On planes
both b are 0, and so is γ; a bump of height ε gives O(ε²).

An edge that has no frame stays as shut as its own two faces leave it: what a network says there
would not turn with the mesh.

A face at a boundary knows one side less: in the last row of a sheet that bends one way, every other
face has no bent side at all. Such a face takes the largest b of itself and its neighbours.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, beside, gather, namespace, scatter
from pns_common.connectivity.topology import EdgeClass, Topology
from pns_common.formula.correction import FrameGate, Gate
from pns_common.formula.gate import gate_of
from pns_common.geometry.frames import EdgeFrames

# x of bends of 46 and 66 degrees.
GENTLE_TO_SHARP = (0.3, 0.6)


def face_bends(jumps: Float[Array, " E"], topology: Topology) -> Float[Array, " F"]:
    """Return b of all faces; ``jumps`` is x of each edge, 0 where it is not interior."""
    xp, (gentle, sharp) = namespace(jumps), GENTLE_TO_SHARP
    counted = jumps * xp.clip((sharp - jumps) / (sharp - gentle), 0.0, 1.0)
    first, second, third = (gather(counted, topology.face_edges[:, k]) for k in range(3))
    own = (first + second + third) / 3
    at_boundary = (topology.edge_class[topology.face_edges] == EdgeClass.BOUNDARY).any(axis=1)
    rows = np.flatnonzero(at_boundary)
    faces = with_neighbours(rows, topology.face_edges, topology.half_edges, topology.edge_class)
    widened = scatter(widest(own, faces), rows, len(topology.faces))
    return xp.where(beside(own, at_boundary), widened, own)


def with_neighbours(
    rows: Int[np.ndarray, " N"],
    face_edges: Int[np.ndarray, "F 3"],
    half_edges: Int[np.ndarray, "E 2"],
    edge_class: Int[np.ndarray, " E"],
) -> Int[np.ndarray, "N 4"]:
    """Return some faces, each with its three neighbours; itself where it has none."""
    sides = face_edges[rows]
    both = half_edges[sides] // 3
    other = np.where(both[:, :, 0] == rows[:, None], both[:, :, 1], both[:, :, 0])
    across = np.where(edge_class[sides] == EdgeClass.INTERIOR, other, rows[:, None])
    return np.concatenate([rows[:, None], across], axis=1)


def widest(bends: Float[Array, " F"], faces: Int[np.ndarray, "N 4"]) -> Float[Array, " N"]:
    """Return the largest b of each row's faces."""
    xp = namespace(bends)
    first, second, third, fourth = (gather(bends, faces[:, k]) for k in range(4))
    return xp.maximum(xp.maximum(first, second), xp.maximum(third, fourth))


def gentle_bend(
    of_first: Float[Array, " N"], of_second: Float[Array, " N"], gate_sharpness: float
) -> Float[Array, " N"]:
    """Return w of edges whose faces have these b; ``gate_sharpness`` is c_v."""
    return of_gentler(namespace(of_first).minimum(of_first, of_second), gate_sharpness)


def of_gentler(bends: Float[Array, " N"], gate_sharpness: float) -> Float[Array, " N"]:
    """Return the same from the smaller b of both faces."""
    return gate_of(gate_sharpness * bends)


def opened(gate: Float[Array, " N"], by: Float[Array, " N"]) -> Float[Array, " N"]:
    """Return γ₂ + (1 − γ₂) w."""
    return gate + (1 - gate) * by


def opened_where_shut(
    gate: Gate, curvature: Float[np.ndarray, " N"], by: Float[np.ndarray, " N"]
) -> Float[np.ndarray, " N"]:
    """Return the same of x; γ₂ is not asked for where few have w < 1.

    Where w is 1, γ is 1 to the last bit: 1 − γ₂ is wrong by no more than half of what rounds to 1.
    """
    rows = np.flatnonzero(by != 1)
    if 2 * len(rows) > len(by):
        return opened(gate(curvature), by)
    gates = np.ones_like(by)
    if len(rows):
        gates[rows] = opened(gate(curvature[rows]), by[rows])
    return gates


def opened_gate(gate: Gate, by: Float[Array, " N"]) -> FrameGate:
    """Return the gate of the two faces, opened by w where an edge has a frame."""

    def both(frames: EdgeFrames) -> Array:
        return opened(gate(frames.curvature), namespace(by).where(frames.degenerate, 0.0, by))

    return both
