"""Steps of baselines, measured against Loop as PNS is."""

import torch
from jaxtyping import Float
from torch import Tensor

from train.connectivity import Connectivity
from train.loop_masks import loop_mask
from train.reference import Step
from train.tensors import dot

# The C of the envelope that methods without a budget are measured against.
COMPARED_BUDGET = 0.5


def placed_edges(
    points: Float[Tensor, "V 3"],
    mesh: Connectivity,
    reference_length: float,
    edges: Float[Tensor, "E 3"],
    vertices: Float[Tensor, "V 3"] | None = None,
) -> Step:
    """Return a step to given positions; the envelope is C h² / R of interior edges alone.

    Old vertices without a position are Loop's.
    """
    base = loop_mask(mesh)(points)
    placed = torch.cat([base[: len(points)] if vertices is None else vertices, edges])
    along = points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]]
    square = torch.where(mesh.paired & (mesh.sharpness < 1), dot(along, along), 0.0)
    envelope = torch.cat([points.new_zeros(len(points)), square])
    envelope = COMPARED_BUDGET / reference_length * envelope
    return Step(base, placed - base, envelope, 0 * envelope, 0 * envelope + 1)


def midpoints(points: Float[Tensor, "V 3"], mesh: Connectivity) -> Float[Tensor, "E 3"]:
    """Return the midpoint of every edge."""
    return points[mesh.edges].mean(dim=1)
