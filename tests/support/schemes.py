"""Schemes that break one promise each: what the certificates must find."""

import numpy as np
from pns_common.geometry.frames import edge_frames, edge_stencil

from pns_common.schemes import Placement, Scheme, loop_edge_rule, loop_vertex_rule

BUDGET, GATE_SHARPNESS = 0.5, 10.0


def along_normal(amount, name="stand-in"):
    """Loop, and ``amount(h, x)`` along the frame's normal on interior edges."""

    def edge_rule(level):
        base, interior = loop_edge_rule(level), level.topology.interior
        stencil = edge_stencil(
            level.points,
            level.normals,
            level.topology.stencil[interior],
            level.topology.edge_faces[interior],
        )
        frames = edge_frames(stencil)
        displacement = np.zeros_like(base.loop)
        size = BUDGET * amount(frames.length, frames.curvature)
        displacement[interior] = size[:, None] * frames.normal
        return Placement(base.loop, displacement, base.ratio, base.gate, base.degenerate)

    return Scheme(name, loop_vertex_rule, edge_rule)


def shifted(scheme, edges=0.0, vertices=0.0):
    """A scheme whose positions are all off by a fixed vector along x."""

    def moved(rule, shift):
        def shifted_rule(level):
            placement = rule(level)
            positions = placement.positions + np.array([shift, 0, 0])
            return Placement(positions, None, placement.ratio, placement.gate, placement.degenerate)

        return shifted_rule

    return Scheme("shifted", moved(scheme.vertex_rule, vertices), moved(scheme.edge_rule, edges))


def gate(x):
    return np.tanh(GATE_SHARPNESS * x**2)


# What the operator does, and what it must not do.
SOUND = along_normal(lambda h, x: h**2 * gate(x), "sound")
TOO_FAR = along_normal(lambda h, x: 3 * h**2 * gate(x))
ONE_POWER_OF_H = along_normal(lambda h, x: h * gate(x))
NO_GATE = along_normal(lambda h, x: h**2)
NO_GATE_ONE_POWER = along_normal(lambda h, x: h)
GATE_OF_ORDER_ONE = along_normal(lambda h, x: h**2 * np.tanh(GATE_SHARPNESS * x))
GATE_WITH_A_KINK = along_normal(lambda h, x: h**2 * np.tanh(np.sqrt(x)))
JUMPING = along_normal(lambda h, x: h**2 * (np.floor(1e6 * h) % 2))
