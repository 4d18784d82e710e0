"""Schemes that break one promise each: what the certificates must find."""

from dataclasses import replace

import numpy as np
import torch

from pns_common import Scheme
from train.reference import Surroundings, edge_frames, on_edges, read_edges
from train.refining import torch_rule

BUDGET, GATE_SHARPNESS = 0.5, 10.0


def along_normal(amount, name="stand-in"):
    """Loop, and ``amount(h, x)`` along the frame's normal on interior edges."""

    def step(points, mesh, reference_length):
        edges = read_edges(Surroundings(mesh, points), first_face=True)
        frames = edge_frames(edges, first_face=True)
        inside = torch.zeros(len(mesh.edges)).double().index_fill(0, mesh.interior, 1.0)
        size = inside * BUDGET * amount(frames.length, frames.curvature)
        displacement = size[:, None] * frames.axes[:, :, 1]
        return on_edges(points, mesh, displacement, BUDGET * inside * frames.length**2, 0 * inside)

    return Scheme(name, rule=torch_rule(step), learned_levels=None)


def shifted(scheme, edges=0.0, vertices=0.0):
    """A scheme whose positions are all off by a fixed vector along x, which no ratio shows."""

    def rule(level):
        made = scheme.rule(level)
        shift = np.zeros_like(made.points)
        shift[: len(level.points), 0], shift[len(level.points) :, 0] = vertices, edges
        return replace(made, points=made.points + shift)

    return Scheme("shifted", rule=rule, learned_levels=None)


def gate(x):
    return torch.tanh(GATE_SHARPNESS * x**2)


# What the operator does, and what it must not do.
SOUND = along_normal(lambda h, x: h**2 * gate(x), "sound")
TOO_FAR = along_normal(lambda h, x: 3 * h**2 * gate(x))
ONE_POWER_OF_H = along_normal(lambda h, x: h * gate(x))
NO_GATE = along_normal(lambda h, x: h**2)
NO_GATE_ONE_POWER = along_normal(lambda h, x: h)
GATE_OF_ORDER_ONE = along_normal(lambda h, x: h**2 * torch.tanh(GATE_SHARPNESS * x))
GATE_WITH_A_KINK = along_normal(lambda h, x: h**2 * torch.tanh(torch.sqrt(x.clamp(min=0))))
JUMPING = along_normal(lambda h, x: h**2 * (torch.floor(1e6 * h) % 2))
