"""The loss on the limit surface: distances and normals over those of the smooth base scheme.

An error of 1 is the base scheme's own, so that gentle surfaces count as much as sharp ones; beyond
1 it grows as a logarithm, so that no single mesh where the scheme is almost right outweighs the
others.
"""

from dataclasses import dataclass, fields

import torch
from jaxtyping import Float
from scipy.spatial import KDTree
from torch import Tensor

from train.fitting.limit_batch import LimitBatch
from train.fitting.sharp_masks import applied
from train.models.recipe import LimitWeights
from train.tensors import dot, unit

# Exponent of the soft maximum of distances.
PEAK = 10

TINY = 1e-30
# Squared chord below which the angle between normals is rounded off.
BLUNT = 1e-6

# No edge counts as surer than this.
LEAST_W = 1e-6

# Errors below these (in R; chords of unit normals) are as good as none.
DISTANCE_FLOOR, NORMAL_FLOOR = 1e-4, 4e-3


@dataclass(frozen=True, eq=False)
class LimitMeasures:
    """Of each of N limit surfaces; lengths, and chords between unit normals.

    Attributes:
        mean, spread, peak: mean, root mean square and soft maximum of the distance along the normal
            of the surface, from the limit and from the surface.
        normal: mean difference of normals.
    """

    mean: Float[Tensor, " N"]
    spread: Float[Tensor, " N"]
    peak: Float[Tensor, " N"]
    normal: Float[Tensor, " N"]


def measure(batch: LimitBatch, second: Float[Tensor, "M 3"]) -> LimitMeasures:
    """Measure the limit surfaces of points after two levels."""
    limit = applied(batch.limit, second)
    corners = limit[batch.faces]
    a, b, c = corners.unbind(dim=1)
    centres, normals = (a + b + c) / 3, unit(torch.linalg.cross(b - a, c - a))
    points, true_points = limit.detach().numpy(), batch.points[batch.back]
    nearest = batch.tree.query(centres.detach().numpy())[1]
    nearest_back = KDTree(points).query(true_points)[1]
    there, true = (torch.from_numpy(table[nearest]) for table in (batch.points, batch.normals))
    away = dot(centres - there, true).abs()
    wrong = torch.sqrt(((normals - true) ** 2).sum(dim=1) + BLUNT)
    offset = limit[nearest_back] - torch.from_numpy(true_points)
    back = dot(offset, torch.from_numpy(batch.normals[batch.back])).abs()
    ones = torch.ones_like(back)
    back_share = ones / batch.per_mesh(ones, batch.back_owner).clamp(min=1)[batch.back_owner]

    def mean(there: Tensor, back: Tensor) -> Tensor:
        return (
            batch.per_mesh(batch.area * there, batch.owner)
            + batch.per_mesh(back_share * back, batch.back_owner)
        ) / 2

    return LimitMeasures(
        mean=mean(away, back),
        spread=(mean(away**2, back**2) + TINY) ** (1 / 2),
        peak=(mean(away**PEAK, back**PEAK) + TINY) ** (1 / PEAK),
        normal=batch.per_mesh(batch.area * wrong, batch.owner),
    )


def limit_loss(
    weights: LimitWeights, measures: LimitMeasures, reference: LimitMeasures
) -> Float[Tensor, ""]:
    """Weigh the terms, and take the mean over the meshes."""
    total = torch.zeros_like(measures.mean)
    for term in fields(LimitMeasures):
        floor = NORMAL_FLOOR if term.name == "normal" else DISTANCE_FLOOR
        mine, base = getattr(measures, term.name), getattr(reference, term.name)
        ratio = (mine + floor) / (base + floor)
        ratio = torch.where(ratio < 1, ratio, 1 + torch.log(ratio))
        short = torch.relu(ratio - weights.worse_from)
        total = total + getattr(weights, term.name) * (ratio + weights.worse * short)
    return total.mean()


def sharpness_loss(batch: LimitBatch, logits: Float[Tensor, " I"]) -> Float[Tensor, ""]:
    """Return the mean over the meshes of the cross entropy of w and truth, weighted by turns."""
    w = (batch.level.cap * torch.sigmoid(logits)).clamp(LEAST_W, 1 - LEAST_W)
    entropy = torch.nn.functional.binary_cross_entropy(w, batch.sharp, reduction="none")
    return batch.per_mesh(batch.edge_share * entropy, batch.edge_owner).mean()
