"""The loss after several steps: each instance's errors at each level, against Loop's.

An error of 1 is Loop's own, so that gentle surfaces count as much as sharp ones. The jump between
neighbouring faces is held against what is allowed instead: somewhat more than Loop's, or what the
surface itself has, which is the most that a perfect result would show.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common.arrays import beside, dot, gather, segment_sum
from pns_common.frames import face_normals
from train.recipes import LevelWeights
from train.rollout import Level, LevelBatch, loop_rollout
from train.surfaces import signed_distance, unit_normal

PEAK = 8
"""Exponent of the soft maximum."""

ALLOWED_JUMP = 1.15
"""Times Loop's: at level 4 the jump is a little further from Loop's than at those trained on."""

LARGEST_ALLOWED = 1.5
"""Times Loop's, where the surface itself would have more: at a border that no rule may move."""

PROJECTIONS = 3
TINY = 1e-30
"""Keeps a root's slope finite; as an eighth root it is 2e-4, and no peak is smaller."""

DISTANCE_FLOOR, NORMAL_FLOOR = 5e-5, 2e-3
"""Errors below these (lengths; chords of unit normals) are as good as none."""


@dataclass(frozen=True, eq=False)
class LevelMeasures:
    """Of each of N instances at one level; lengths, and chords between unit normals.

    Attributes:
        distance, peak: root mean square and soft maximum of |f| / ‖∇f‖ over all vertices.
        inserted, inserted_peak: the same over the vertices of interior edges.
        normal: root mean square difference of face normals from the surface's.
        jump: soft maximum of the difference between neighbouring face normals.
    """

    distance: Float[Tensor, " N"]
    peak: Float[Tensor, " N"]
    inserted: Float[Tensor, " N"]
    inserted_peak: Float[Tensor, " N"]
    normal: Float[Tensor, " N"]
    jump: Float[Tensor, " N"]


AGAINST_LOOP = tuple(field.name for field in fields(LevelMeasures) if field.name != "jump")


@dataclass(frozen=True, eq=False)
class Reference:
    """What one level is held against: Loop's own measures, and the jump that is allowed."""

    loop: LevelMeasures
    allowed_jump: Float[Tensor, " N"]


def measure(level: Level, points: Float[Tensor, "V 3"], count: int) -> LevelMeasures:
    """Measure `count` instances at one level."""
    distance = signed_distance(level.at_vertices, points)
    inserted = gather(distance, level.inserted)
    normals = face_normals(points, level.faces)
    centroids = sum(gather(points, level.faces[:, corner]) for corner in range(3)) / 3
    wrong = normals - unit_normal(level.at_faces, centroids)
    jump = gather(normals, level.pairs[:, 0]) - gather(normals, level.pairs[:, 1])
    of_inserted = level.vertex_owner[level.inserted]
    return LevelMeasures(
        distance=_power_mean(distance**2, 1, level.vertex_owner, count),
        peak=_power_mean(distance**2, PEAK // 2, level.vertex_owner, count),
        inserted=_power_mean(inserted**2, 1, of_inserted, count),
        inserted_peak=_power_mean(inserted**2, PEAK // 2, of_inserted, count),
        normal=_power_mean(dot(wrong, wrong), 1, level.face_owner, count),
        jump=_power_mean(dot(jump, jump), PEAK // 2, level.pair_owner, count),
    )


def references(batch: LevelBatch) -> list[Reference]:
    """Measure Loop at every level, and the jump of Loop's mesh laid onto the surface."""
    found = []
    with torch.no_grad():
        for level, points in zip(batch.levels, loop_rollout(batch), strict=True):
            loop = measure(level, points, batch.count)
            for _ in range(PROJECTIONS):
                gradient = level.at_vertices.gradient(points)
                step = level.at_vertices.value(points) / dot(gradient, gradient)
                points = points - step[:, None] * gradient
            own = measure(level, points, batch.count).jump
            allowed = torch.minimum(
                torch.maximum(ALLOWED_JUMP * loop.jump, own), LARGEST_ALLOWED * loop.jump
            )
            found.append(Reference(loop, allowed))
    return found


def level_loss(
    weights: LevelWeights, found: LevelMeasures, reference: Reference
) -> Float[Tensor, ""]:
    """Weigh one level's terms, and take the mean over the instances."""
    ratios = {
        name: _ratio(name, getattr(found, name), getattr(reference.loop, name))
        for name in AGAINST_LOOP
    }
    beyond = _ratio("jump", found.jump, reference.allowed_jump) - 1
    loss = weights.jump * torch.relu(beyond)
    for name, ratio in ratios.items():
        weight = getattr(weights, name)
        if weight > 0:
            loss = loss + weight * ratio + weights.worse * torch.relu(ratio - 1)
    return loss.mean()


def rollout_loss(
    weights: Sequence[LevelWeights],
    batch: LevelBatch,
    points: Sequence[Float[Tensor, "V 3"]],
    reference: Sequence[Reference],
) -> Float[Tensor, ""]:
    """Sum the loss over the levels."""
    total = torch.zeros((), dtype=batch.points.dtype, device=batch.points.device)
    for weight, level, at, held in zip(weights, batch.levels, points, reference, strict=True):
        total = total + level_loss(weight, measure(level, at, batch.count), held)
    return total


def _ratio(
    name: str, found: Float[Tensor, " N"], reference: Float[Tensor, " N"]
) -> Float[Tensor, " N"]:
    """Return found / reference, which tends to 1 where both are below the floor."""
    floor = NORMAL_FLOOR if name in ("normal", "jump") else DISTANCE_FLOOR
    return torch.sqrt((found**2 + floor**2) / (reference**2 + floor**2))


def _power_mean(
    squares: Float[Tensor, " M"], power: int, owner: Int[np.ndarray, " M"], count: int
) -> Float[Tensor, " N"]:
    """Return (mean of squares^power)^(1 / 2 power) of each instance, with a slope at 0."""
    sizes = beside(squares, np.maximum(np.bincount(owner, minlength=count), 1))
    total = segment_sum((squares**power)[:, None], owner, count)[:, 0]
    return (total / sizes + TINY) ** (0.5 / power)
