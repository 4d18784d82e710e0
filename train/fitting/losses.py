"""The four terms of the training loss, each a mean over inserted vertices or pairs of them.

Source: paper, Setup, baselines, and metrics.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.models.recipe import LossWeights
from train.tensors import dot, unit


def distance_loss(distance: Float[Tensor, " I"]) -> Float[Tensor, ""]:
    """Return L_sdf: mean squared signed distance of inserted vertices to the surface."""
    return (distance**2).mean()


def normal_loss(
    normals: Float[Tensor, "I 3"], surface_normals: Float[Tensor, "I 3"]
) -> Float[Tensor, ""]:
    """Return L_n: mean of 1 − n·n*, between the refined mesh's normals and the surface's."""
    return (1 - dot(normals, surface_normals)).mean()


def fairness_loss(normals: Float[Tensor, "I 3"], pairs: Int[Tensor, "P 2"]) -> Float[Tensor, ""]:
    """Return L_fair: mean squared difference of normals over pairs of new vertices on one face."""
    first, second = normals[pairs].unbind(dim=1)
    return ((first - second) ** 2).sum(dim=-1).mean()


def proximity_loss(ratio: Float[Tensor, " I"]) -> Float[Tensor, ""]:
    """Return L_prox: mean squared proximity ratio.

    The bound itself is architectural; this term only discourages spending without gain.
    """
    return (ratio**2).mean()


def weighted_loss(
    weights: LossWeights,
    distance: Float[Tensor, " I"],
    normals: Float[Tensor, "I 3"],
    surface_normals: Float[Tensor, "I 3"],
    ratio: Float[Tensor, " I"],
    pairs: Int[Tensor, "P 2"],
) -> Float[Tensor, ""]:
    """Sum the four terms with the recipe's weights."""
    return (
        weights.distance * distance_loss(distance)
        + weights.normal * normal_loss(normals, surface_normals)
        + weights.fairness * fairness_loss(normals, pairs)
        + weights.proximity * proximity_loss(ratio)
    )


def vertex_normals(points: Float[Tensor, "V 3"], faces: Int[Tensor, "F 3"]) -> Float[Tensor, "V 3"]:
    """Return unit vertex normals, incident faces weighted by area."""
    a, b, c = (points[corner] for corner in faces.T)
    areas = torch.linalg.cross(b - a, c - a).repeat(3, 1)
    return unit(torch.zeros_like(points).index_add(0, faces.T.reshape(-1), areas))
