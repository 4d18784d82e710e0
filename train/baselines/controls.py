"""Untrained controls: what anyone can have without a network. A learned rule has to beat them.

Loop's limit surface runs inside a convex control mesh. With e_v = p_v − (Loop's limit position of
v), m_v the unit normal of the faces at v, weighted by area:

    flat   no refinement at all: every edge at its midpoint
    Q1     Loop on p + e: full quasi-interpolation, once
    N1     Loop on p + (e · m) m: the same along the normal
    NC     N1 × 0.6, each vertex's share of it clipped to C h² / R, and at edges gated, as PNS is
"""

from collections.abc import Callable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from train.baselines.placement import midpoints, placed_edges
from train.connectivity import Connectivity
from train.loop_masks import limit_weight, loop_mask
from train.reference import Step, Surroundings, edge_frames, read_edges
from train.refining import Method, loop_rule
from train.tensors import dot, shortened, unit

CLIPPED_STRENGTH = 0.6
# C of NC, in units of R.
CLIPPED_BUDGET = 0.8

GATE = 1e5

Push = Callable[[Float[Tensor, "V 3"], Connectivity], Float[Tensor, "V 3"]]


def flat() -> Method:
    """Return midpoint subdivision: the control mesh itself, with more faces."""

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        return placed_edges(points, mesh, reference_length, midpoints(points, mesh), points)

    return Method("flat", step)


def q1() -> Method:
    """Return full quasi-interpolation at the first level, then Loop."""
    return _pushed("q1", full_push)


def n1(*, keeps_creases: bool = False) -> Method:
    """Return quasi-interpolation along the normal at the first level, then Loop."""
    return replace(_pushed("n1", normal_push), keeps_creases=keeps_creases)


def nc() -> Method:
    """Return 0.6 of N1, gated at edges and clipped to C h² / R at the first level, then Loop."""

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        around = Surroundings(mesh, points)
        share = loop_mask(mesh)(CLIPPED_STRENGTH * normal_push(points, mesh))
        frames = edge_frames(read_edges(around, first_face=True), first_face=True)
        interior = mesh.paired & (mesh.sharpness < 1)
        gate = torch.where(interior, torch.tanh(GATE * frames.curvature**2), 0.0)
        squares = torch.cat([around.square[:, 0], frames.length**2])
        clipped = shortened(share, CLIPPED_BUDGET / reference_length * squares)
        gates = torch.cat([points.new_ones(len(points)), gate])
        return replace(
            loop_rule(points, mesh, reference_length), displacement=gates[:, None] * clipped
        )

    return Method("nc", step, learned_levels=1)


def _pushed(name: str, push: Push) -> Method:
    """Return Loop on a control mesh whose vertices were pushed once."""

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        pushed = loop_mask(mesh)(push(points, mesh))
        return replace(loop_rule(points, mesh, reference_length), displacement=pushed)

    return Method(name, step, learned_levels=1)


def normal_push(points: Float[Tensor, "V 3"], mesh: Connectivity) -> Float[Tensor, "V 3"]:
    """Return (e · m) m of every vertex, m its unit normal."""
    normal = unit(Surroundings(mesh, points).mean_normal)
    return dot(full_push(points, mesh), normal)[:, None] * normal


def full_push(points: Float[Tensor, "V 3"], mesh: Connectivity) -> Float[Tensor, "V 3"]:
    """Return e: what Loop's limit takes from every vertex.

    Inside it is w (p − mean of the neighbours) with w = 8 k β / (8 k β + 3), also where one crease
    ends; on curves (2 p − both neighbours) / 6; corners and isolated vertices stay.
    """
    around, (_, second, third) = Surroundings(mesh, points), mesh.sharpest[0].T
    inside = -limit_weight(mesh.valence)[:, None] * around.umbrella
    beside = points[mesh.sharpest[1]]
    curve = (2 * points - beside[:, 0] - beside[:, 1]) / 6
    return (1 - second)[:, None] * inside + (second - third)[:, None] * curve
