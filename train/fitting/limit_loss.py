"""The loss on the limit surface: distances, normals and fairness, each over Loop's.

An error of 1 is Loop's own, so that gentle surfaces count as much as sharp ones; beyond 1 it grows
as a logarithm, so that no single mesh where Loop is almost right outweighs the others.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from numba import njit
from scipy.spatial import KDTree
from torch import Tensor

from train.fitting.limit_batch import LimitBatch, LimitSurface
from train.models.recipe import LimitWeights

# Exponents of the soft maxima of distances, and of turns between neighbouring normals.
PEAK, JUMP = 10, 16

TINY = 1e-30
# Squared chord below which the angle between normals is rounded off.
BLUNT = 1e-6

# Errors below these (in R; chords of unit normals; no unit; chords) are as good as none.
DISTANCE_FLOOR, NORMAL_FLOOR, BEND_FLOOR, JUMP_FLOOR = 1e-4, 4e-3, 1e-2, 1e-3

ACCURACY = ("mean", "spread", "peak", "normal", "normal_spread")
# Faces with twice their area below this share of their squared sides do not count as bent.
NO_AREA = 1e-9


@dataclass(frozen=True, eq=False)
class LimitMeasures:
    """Of each of N limit surfaces; lengths, and chords between unit normals.

    Attributes:
        mean, spread, peak: mean, root mean square and soft maximum of the distance to the tangent
            plane of the surface's nearest point; mean and peak also from the surface back.
        normal, normal_spread: mean and root mean square difference of normals.
        bend: ∫ (κ₁² + κ₂²) dA, as train.metrics.shape has it.
        jump: soft maximum of the chord between neighbouring normals of the finer level.
    """

    mean: Float[Tensor, " N"]
    spread: Float[Tensor, " N"]
    peak: Float[Tensor, " N"]
    normal: Float[Tensor, " N"]
    normal_spread: Float[Tensor, " N"]
    bend: Float[Tensor, " N"]
    jump: Float[Tensor, " N"]


@dataclass(frozen=True, eq=False)
class Standards:
    """What a batch is held against: Loop's measures, and how much the prior alone bends."""

    loop: LimitMeasures
    prior: LimitMeasures


def measure(batch: LimitBatch, learned: Float[Tensor, "V 3"]) -> LimitMeasures:
    """Measure the limit surfaces of the points that one level has made of a batch."""
    limit = batch.limit(learned)
    points = limit.points.detach().numpy()
    # Torch runs on one thread, and what is nearest takes a quarter of its time.
    with ThreadPoolExecutor(2) as beside:
        search = beside.submit(batch.tree.query, points)
        search_back = beside.submit(_nearest, points, batch.points[batch.back])
        bend, jump = _bending(batch, batch.fair_limit(learned))
    (_, nearest), nearest_back = search.result(), search_back.result()
    at, normals = (torch.from_numpy(table[nearest]) for table in (batch.points, batch.normals))
    away = ((limit.points - at) * normals).sum(dim=1).abs()
    wrong = ((limit.normals - normals) ** 2).sum(dim=1)
    back = _looked_at_back(batch, limit, nearest_back)
    seen = torch.ones_like(back)
    back_share = seen / batch.per_mesh(seen, batch.back_owner).clamp(min=1)[batch.back_owner]

    def mean(values: Tensor) -> Tensor:
        return batch.per_mesh(batch.area * values, batch.owner)

    def smooth_mean(values: Tensor) -> Tensor:
        return batch.per_mesh(batch.smooth_area * values, batch.owner)

    def back_mean(values: Tensor) -> Tensor:
        return batch.per_mesh(back_share * values, batch.back_owner)

    peaks = [_root(mean(away**PEAK), PEAK), _root(back_mean(back**PEAK), PEAK)]
    return LimitMeasures(
        mean=(mean(away) + back_mean(back)) / 2,
        spread=_root(mean(away**2), 2),
        peak=(peaks[0] + peaks[1]) / 2,
        normal=smooth_mean(torch.sqrt(wrong + BLUNT)),
        normal_spread=_root(smooth_mean(wrong), 2),
        bend=bend,
        jump=jump,
    )


def limit_loss(
    weights: LimitWeights, batch: LimitBatch, measures: LimitMeasures, standards: Standards
) -> Float[Tensor, ""]:
    """Weigh the terms, and take the mean over the meshes."""
    total = torch.zeros_like(measures.mean)
    for name in ACCURACY:
        floor = NORMAL_FLOOR if name.startswith("normal") else DISTANCE_FLOOR
        ratio = _ratio(getattr(measures, name), getattr(standards.loop, name), floor)
        short = torch.relu(ratio - weights.worse_from)
        total = total + getattr(weights, name) * (ratio + weights.worse * short)
    total = torch.where(batch.authored, 0.0, total)
    usual = torch.where(batch.authored, standards.loop.bend, standards.prior.bend)
    bend = torch.log((measures.bend + BEND_FLOOR) / (usual + BEND_FLOOR))
    total = total + weights.bend * bend + _too_much(weights, batch, bend)
    jump = torch.log((measures.jump + JUMP_FLOOR) / (standards.loop.jump + JUMP_FLOOR))
    total = total + weights.jump * torch.relu(jump - weights.allowed_jump)
    return total.mean()


def _too_much(weights: LimitWeights, batch: LimitBatch, bend: Tensor) -> Float[Tensor, " N"]:
    """Weigh bending above what each kind of mesh may have."""
    kinds = ((batch.smooth, weights.smooth_bend), (batch.authored, weights.authored_bend))
    allowed = torch.full_like(bend, weights.sharp_bend)
    for kind, most in kinds:
        allowed = torch.where(kind, most, allowed)
    weight = torch.where(batch.smooth | batch.authored, weights.ripples, weights.sharp)
    return weight * torch.relu(bend - torch.log(allowed))


def _ratio(measure: Tensor, reference: Tensor, floor: float) -> Tensor:
    ratio = (measure + floor) / (reference + floor)
    return torch.where(ratio < 1, ratio, 1 + torch.log(ratio))


def _bending(batch: LimitBatch, limit: LimitSurface) -> tuple[Tensor, Tensor]:
    """Return bending and jump; cotangents and areas from the squared lengths of sides alone."""
    square, turned = (
        squared_chords(values, batch.fair_edges) for values in (limit.points, limit.normals)
    )
    a, b, c = (square[batch.fair_sides[:, side]] for side in range(3))
    u, v, w = (turned[batch.fair_sides[:, side]] for side in range(3))
    total = a + b + c
    # Heron: 4 × area, and 4 × area × cotangent opposite a is b + c − a.
    fourfold = torch.sqrt(torch.relu(total**2 - 2 * (a * a + b * b + c * c)) + TINY)
    energy = (u * (total - 2 * a) + v * (total - 2 * b) + w * (total - 2 * c)) / 2
    bend = energy / (fourfold + NO_AREA * total)
    peak = batch.per_mesh(turned ** (JUMP // 2), batch.fair_edge_owner)
    return batch.per_mesh(bend, batch.fair_owner), _root(peak, JUMP)


def _nearest(
    points: Float[np.ndarray, "M 3"], to: Float[np.ndarray, "B 3"]
) -> Int[np.ndarray, " B"]:
    """Return which of some points is nearest to each of others."""
    return np.asarray(KDTree(points).query(to)[1])


def _looked_at_back(
    batch: LimitBatch, limit: LimitSurface, nearest: Int[np.ndarray, " B"]
) -> Float[Tensor, " B"]:
    """Return the distances of surface points to the tangent planes of their nearest vertices."""
    smooth = torch.from_numpy(batch.maps.smooth[nearest])[:, None]
    own = torch.from_numpy(batch.normals[batch.back])
    normals = torch.where(smooth, limit.normals[nearest].detach(), own)
    offset = limit.points[nearest] - torch.from_numpy(batch.points[batch.back])
    return (offset * normals).sum(dim=1).abs()


def _root(values: Tensor, power: int) -> Tensor:
    return (values + TINY) ** (1 / power)


def squared_chords(
    values: Float[Tensor, "N 3"], ends: Int[np.ndarray, "E 2"]
) -> Float[Tensor, " E"]:
    """Return |v₁ − v₀|² for each pair of rows, with the bits that torch's own operations have."""
    return _SquaredChords.apply(values, ends)


class _SquaredChords(torch.autograd.Function):
    """Torch gathers, subtracts, squares and sums one after the other, and takes longer."""

    @staticmethod
    def forward(ctx: Any, values: Tensor, ends: Int[np.ndarray, "E 2"]) -> Tensor:
        rows = np.ascontiguousarray(values.detach().numpy())
        ctx.rows, ctx.ends = rows, ends
        return torch.from_numpy(_lengths(rows, ends))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        back = _gradient(ctx.rows, ctx.ends, np.ascontiguousarray(gradient.numpy()))
        return torch.from_numpy(back), None


@njit(cache=True)
def _lengths(rows, ends):
    square = np.empty(len(ends))
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        x, y, z = rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1], rows[b, 2] - rows[a, 2]
        square[e] = x * x + y * y + z * z
    return square


@njit(cache=True)
def _gradient(rows, ends, gradient):
    # What first and second ends get is summed apart, as torch does.
    first, second = np.zeros(rows.shape), np.zeros(rows.shape)
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        for k in range(3):
            change = gradient[e] * (2 * (rows[b, k] - rows[a, k]))
            second[b, k] += change
            first[a, k] -= change
    return first + second
