"""Gradient ascent over weights and mesh at once, against what the rule of directed edges promises.

Each search climbs a smooth stand-in of a promise that any weights must keep; the promise itself is
measured at every step, from positions. Networks are in double precision.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pns_common import Mesh
from train.certificates.learned_once import largest_turn
from train.connectivity import Connectivity, connect
from train.directed_rule import DirectedRule
from train.loop_masks import limit_mask
from train.models.directed import DirectedNet
from train.models.recipe import DirectedForm
from train.reference import Step, Surroundings

RATE = 0.03
PEAK = 8

# A step, and the connectivity of the mesh that it made.
Goal = Callable[[Step, Connectivity], Tensor]


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
    goal: Goal,
    mesh: Mesh,
    form: DirectedForm,
    seed: int,
    steps: int,
    loudness: float = 1.0,
) -> Worst:
    """Climb a goal from random weights, `loudness` times their usual size, and from a mesh."""
    generator = torch.Generator().manual_seed(seed)
    network = DirectedNet(generator, form.width, form.hidden, form.rounds).double()
    with torch.no_grad():
        for weight in network.parameters():
            weight *= loudness
    rule = DirectedRule(
        network,
        form.budget,
        form.gate_sharpness,
        form.vertex_gate_sharpness,
        form.curve_strength,
        form.network_scale,
        form.fold_angle,
    )
    level = connect(np.array(mesh.faces), len(mesh.vertices))
    after = connect(level.split().numpy(), level.vertex_count + len(level.edges))
    points = torch.tensor(mesh.vertices, requires_grad=True)
    optimiser = torch.optim.Adam([points, *network.parameters()], lr=RATE)
    seen: list[tuple[float, ...]] = []
    for _ in range(steps):
        step = rule(points, level)
        value = goal(step, after)
        seen.append((*promises(step, after, form.fold_angle), value.item()))
        optimiser.zero_grad()
        (-value).backward()
        optimiser.step()
    worst = np.max(np.array(seen), axis=0)
    return Worst(*worst[:4].tolist(), climbed=seen[-1][4] - seen[0][4])


def promises(
    step: Step, after: Connectivity, fold_angle: float
) -> tuple[float, float, float, float]:
    """Measure turn, displacement, limit and overshoot, each over what is allowed."""
    base, made = step.base.detach().numpy(), step.points.detach().numpy()
    turn = largest_turn(after.faces.numpy(), base, made) / fold_angle
    apart, allowed = np.linalg.norm(made - base, axis=1), step.envelope.detach().numpy()
    rounding = 1e-14 * np.abs(base).max()
    longest = apart.max() + rounding
    limit = torch.linalg.vector_norm(_limits_apart(step, after).detach(), dim=1).max().item()
    beyond = np.maximum(made - base.max(axis=0), base.min(axis=0) - made).max() / longest
    share = float((apart / (allowed + rounding)).max())
    return turn, share, limit / longest, float(beyond)


def turning(step: Step, after: Connectivity) -> Tensor:
    """Climb towards folds: a soft largest chord between the normals of child faces and Loop's."""
    made, base = (Surroundings(after, points).normals for points in (step.points, step.base))
    return (((made - base) ** 2).sum(dim=1) ** (PEAK // 2)).mean()


def overshooting(step: Step, after: Connectivity) -> Tensor:
    """Climb out of Loop's bounding box."""
    high, low = step.base.amax(dim=0).detach(), step.base.amin(dim=0).detach()
    return torch.relu(torch.maximum(step.points - high, low - step.points)).sum()


def leaving(step: Step, after: Connectivity) -> Tensor:
    """Climb away from Loop's limit surface."""
    return ((_limits_apart(step, after) ** 2).sum(dim=1) ** (PEAK // 2)).sum()


def _limits_apart(step: Step, after: Connectivity) -> Float[Tensor, "W 3"]:
    return limit_mask(after)(step.points - step.base)


GOALS: Mapping[str, Goal] = MappingProxyType(
    {"fold": turning, "overshoot": overshooting, "limit distance": leaving}
)
