"""Gradient ascent over weights and mesh at once, against what the scale-free rule promises.

Each search climbs a smooth stand-in of a promise that any weights must keep; the promise itself is
measured at every step, from positions. Networks are tied ones, in double precision.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pns_common.connectivity.topology import Topology, build_topology, split
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.orientation import SYMMETRIC
from pns_common.features.ring_features import RING_10
from pns_common.formula.correction import curvature_gate
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.levels.step import LevelStep, level_step
from pns_common.masks.limit import refined_limit_positions
from pns_common.mesh import Mesh
from pns_common.rules.control_level import control_level
from pns_common.rules.scale_free_form import ScaleFreeForm
from pns_common.schemes import loop, scale_free_scheme
from train.certificates.learned_once import largest_turn
from train.models.networks import unit_correction
from train.models.tied import TiedNet
from train.refining import AnyScheme
from train.vectors import face_normals

RATE = 0.03
GATE_SHARPNESS, VERTEX_GATE_SHARPNESS = 1e6, 1e3
PEAK = 8

Goal = Callable[[LevelStep, Topology], Tensor]


@dataclass(frozen=True, slots=True)
class Worst:
    """The worst that a search saw, each as a share of what is allowed.

    Attributes:
        turn: largest turn of a child face over θ.
        displacement: largest displacement over its own ρ.
        limit: largest distance between the limits over the largest displacement.
        overshoot: how far the result leaves Loop's bounding box, over the same.
        climbed: the goal in the end less the goal at first.
    """

    turn: float
    displacement: float
    limit: float
    overshoot: float
    climbed: float


def ascend(
    goal: Goal, mesh: Mesh, form: ScaleFreeForm, seed: int, steps: int, loudness: float = 1.0
) -> Worst:
    """Climb a goal from random weights, `loudness` times their usual size, and from a mesh."""
    generator = torch.Generator().manual_seed(seed)
    edges = TiedNet(FEATURE_SETS["signed-18"].symmetries, (2, 2), "gelu", generator).double()
    vertices = TiedNet(RING_10.symmetries, (4,), "gelu", generator).double()
    with torch.no_grad():
        for weight in (*edges.parameters(), *vertices.parameters()):
            weight *= loudness
    scheme = scale_free_scheme(
        EdgeOperator(
            FEATURE_SETS["signed-18"],
            SYMMETRIC,
            unit_correction(edges),
            curvature_gate(GATE_SHARPNESS),
        ),
        VertexOperator(RING_10, unit_correction(vertices), VERTEX_GATE_SHARPNESS),
        form,
    )
    topology = build_topology(np.array(mesh.faces), len(mesh.vertices))
    points = torch.tensor(mesh.vertices, requires_grad=True)
    optimiser = torch.optim.Adam([points, *edges.parameters(), *vertices.parameters()], lr=RATE)
    seen: list[tuple[float, ...]] = []
    for _ in range(steps):
        step = level_step(control_level(points, topology), scheme)
        value = goal(step, topology)
        seen.append((*promises(step, topology, scheme, points), value.item()))
        optimiser.zero_grad()
        (-value).backward()
        optimiser.step()
    worst = np.max(np.array(seen), axis=0)
    return Worst(*worst[:4].tolist(), climbed=seen[-1][4] - seen[0][4])


def promises(
    step: LevelStep, topology: Topology, scheme: AnyScheme, points: Float[Tensor, "V 3"]
) -> tuple[float, float, float, float]:
    """Measure turn, displacement, limit and overshoot, each over what is allowed."""
    base = level_step(control_level(points.detach(), topology), loop()).points.numpy()
    made = step.points.detach().numpy()
    assert scheme.guard is not None
    turn = largest_turn(split(topology), base, made) / np.degrees(scheme.guard.angle)
    apart = np.linalg.norm(made - base, axis=1)
    rules = (step.vertices, step.edges)
    envelopes = [rule.envelope for rule in rules if rule.envelope is not None]
    allowed = torch.cat(envelopes).detach().numpy()
    rounding = 1e-14 * np.abs(base).max()
    longest = apart.max() + rounding
    limits = [refined_limit_positions(points, topology) for points in (made, base)]
    limit = np.linalg.norm(limits[0] - limits[1], axis=1).max() / longest
    beyond = np.maximum(made - base.max(axis=0), base.min(axis=0) - made).max() / longest
    return turn, float((apart / (allowed + rounding)).max()), float(limit), float(beyond)


def turning(step: LevelStep, topology: Topology) -> Tensor:
    """Climb towards folds: a soft largest chord between the normals of child faces and Loop's."""
    faces = split(topology)
    assert step.loop_points is not None
    apart = face_normals(step.points, faces) - face_normals(step.loop_points, faces)
    return ((apart**2).sum(dim=1) ** (PEAK // 2)).mean()


def overshooting(step: LevelStep, topology: Topology) -> Tensor:
    """Climb out of Loop's bounding box."""
    assert step.loop_points is not None
    high, low = step.loop_points.amax(dim=0).detach(), step.loop_points.amin(dim=0).detach()
    return torch.relu(torch.maximum(step.points - high, low - step.points)).sum()


def leaving(step: LevelStep, topology: Topology) -> Tensor:
    """Climb away from Loop's limit surface."""
    assert step.loop_points is not None
    limits = [refined_limit_positions(limit, topology) for limit in (step.points, step.loop_points)]
    return (((limits[0] - limits[1]) ** 2).sum(dim=1) ** (PEAK // 2)).sum()


GOALS: Mapping[str, Goal] = MappingProxyType(
    {"fold": turning, "overshoot": overshooting, "limit distance": leaving}
)
