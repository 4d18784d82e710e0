"""A gate that reads the sides of an edge's two faces: it is open on the diagonal of a plane quad.

    γ = γ₂ + (1 − γ₂) w,   w = tanh(c_v min(b_1, b_2)),   b_i = mean of x f(x) over face i's edges

γ₂ is the gate of an edge's own two faces, which is shut where they lie in one plane. That is right
on the flat sides of a part with sharp edges. But the two halves of a plane quad lie in one plane on
any surface, and moving all edges but the diagonals shows as ripples. So an edge is also corrected
where both its faces bend gently across some edge: x is 1 − n · n' there, and f falls from 1 to 0
over GENTLE_TO_SHARP. A right angle has x = 1 and does not count: on a box all sides stay shut, on a
prism of many sides the walls are open, however few rows they have, and its lids are not. On planes
both b are 0, and so is γ; a bump of height ε gives O(ε²).
"""

from __future__ import annotations

from jaxtyping import Float

from pns_common.base.arrays import Array, gather, namespace
from pns_common.connectivity.topology import Topology
from pns_common.formula.correction import Gate
from pns_common.geometry.frames import EdgeFrames

# x of bends of 46 and 66 degrees.
GENTLE_TO_SHARP = (0.3, 0.6)


def face_bends(jumps: Float[Array, " E"], topology: Topology) -> Float[Array, " F"]:
    """Return b of all faces; ``jumps`` is x of each edge, 0 where it is not interior."""
    xp, (gentle, sharp) = namespace(jumps), GENTLE_TO_SHARP
    counted = jumps * xp.clip((sharp - jumps) / (sharp - gentle), 0.0, 1.0)
    first, second, third = (gather(counted, topology.face_edges[:, k]) for k in range(3))
    return (first + second + third) / 3


def gentle_bend(
    of_first: Float[Array, " N"], of_second: Float[Array, " N"], gate_sharpness: float
) -> Float[Array, " N"]:
    """Return w of edges whose faces have these b; ``gate_sharpness`` is c_v."""
    return of_gentler(namespace(of_first).minimum(of_first, of_second), gate_sharpness)


def of_gentler(bends: Float[Array, " N"], gate_sharpness: float) -> Float[Array, " N"]:
    """Return the same from the smaller b of both faces."""
    return namespace(bends).tanh(gate_sharpness * bends)


def opened(gate: Float[Array, " N"], by: Float[Array, " N"]) -> Float[Array, " N"]:
    """Return γ₂ + (1 − γ₂) w."""
    return gate + (1 - gate) * by


def opened_gate(gate: Gate, by: Float[Array, " N"]) -> Gate:
    """Return the gate of the two faces, opened by w."""

    def both(frames: EdgeFrames) -> Array:
        return opened(gate(frames), by)

    return both
