"""The quiet term: no correction where the training set has nothing to say.

A network trained on gentle ridges answers on a cube too, at random and with its whole budget: the
bound holds, and the surface is torn. So training also draws features from outside those of its
meshes and asks for η = 0 there; the further outside, the more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pns_common import Mesh, ParameterError
from train.connectivity import connect
from train.models.networks import BoundedNet
from train.reference import Surroundings, edge_frames, paper_5, read_edges

# Half of the draws: a training edge, bent by any curvature x ∈ [0, 2], its shape moved a little.
# The other half: any curvature, and any shape up to edges e^1.5 times as long as another.
DRAWS = 2048
SHAPE_NOISE, WIDEST_SHAPE = 0.1, 1.5
# Outside by this much, a draw counts in full.
MARGIN = 0.2


@dataclass(frozen=True, eq=False)
class Support:
    """The features of the training set: every row, and the box around them."""

    rows: Float[Tensor, "N K"]
    low: Float[Tensor, " K"]
    high: Float[Tensor, " K"]


def support_of(meshes: list[Mesh]) -> Support:
    """Return the features `paper-5` at the interior edges of the training meshes."""
    rows = torch.cat([_edge_features(mesh) for mesh in meshes]).to(torch.float32)
    return Support(rows, rows.amin(dim=0), rows.amax(dim=0))


def draw_features(support: Support, generator: torch.Generator) -> Float[Tensor, "D K"]:
    """Draw features of edges that the training set may not have; the first is the curvature."""
    half, width = DRAWS // 2, support.rows.shape[1] - 1
    chosen = torch.randint(len(support.rows), (half,), generator=generator)
    noise = SHAPE_NOISE * torch.randn(half, width, generator=generator)
    any_shape = WIDEST_SHAPE * (2 * torch.rand(half, width, generator=generator) - 1)
    curvature = 2 * torch.rand(2 * half, 1, generator=generator)
    shapes = torch.cat([support.rows[chosen, 1:] + noise, any_shape])
    return torch.cat([curvature, shapes], dim=1)


def quiet_loss(
    network: BoundedNet, support: Support, features: Float[Tensor, "D K"]
) -> Float[Tensor, ""]:
    """Return mean ‖η‖² at budget 1, weighed from 0 inside the box to 1 at the margin outside it."""
    outside = torch.maximum(support.low - features, features - support.high).amax(dim=1)
    weight = (outside / MARGIN).clamp(0, 1)
    return (weight * (network(features, 1.0) ** 2).sum(dim=1)).mean()


def quiet_term(
    meshes: list[Mesh], features: str, seed: int
) -> Callable[[BoundedNet], Float[Tensor, ""]]:
    """Return the quiet loss of a network, on features drawn anew at every call.

    Raises:
        ParameterError: the features are not `paper-5`: others read data of vertices, which no draw
            has.
    """
    if features != "paper-5":
        raise ParameterError("quiet", features, expected="features of an edge, as paper-5")
    support = support_of(meshes)
    generator = torch.Generator().manual_seed(seed)
    return lambda network: quiet_loss(network, support, draw_features(support, generator))


def _edge_features(mesh: Mesh) -> Float[Tensor, "I 5"]:
    level = connect(mesh.faces, len(mesh.vertices))
    around = Surroundings(level, torch.tensor(mesh.vertices))
    edges = read_edges(around, first_face=True)
    return paper_5(around, edges, edge_frames(edges, first_face=True))[level.interior]
