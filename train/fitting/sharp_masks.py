"""Masks with sharpness, differentiable in it: blends of a smooth scheme, curves, and staying.

    edge vertex     (1 − w) smooth + w middle
    old vertex      (1 − w₂) smooth + (w₂ − w₃) curve(edges 1, 2) + w₃ p

w₁ ≥ w₂ ≥ w₃ … are the weights around a vertex. The smooth rules come as a sparse matrix, of any
scheme whose rows are old vertices, edges, and then anything else.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.loop_masks import CURVE_CENTRE, CURVE_SIDE, MIDDLE


@dataclass(frozen=True, eq=False)
class Sharpness:
    """w of each edge, and around each vertex.

    Attributes:
        edge: w.
        second, third: w₂ and w₃ of each vertex.
        edges: the two sharpest edges of each vertex; any where it has fewer.
        ends: their other ends.
    """

    edge: Float[Tensor, " E"]
    second: Float[Tensor, " V"]
    third: Float[Tensor, " V"]
    edges: Int[Tensor, "V 2"]
    ends: Int[Tensor, "V 2"]


def around_vertices(
    edges: Int[Tensor, "E 2"], sharpness: Float[Tensor, " E"], vertex_count: int
) -> Sharpness:
    """Put the edges at each vertex in the order of their sharpness."""
    centres = edges.numpy().reshape(-1)
    weights = sharpness.detach().numpy().repeat(2)
    order = np.lexsort((-weights, centres))
    sorted_centres = centres[order]
    rank = np.arange(len(order)) - np.searchsorted(sorted_centres, sorted_centres)
    spokes = np.full((vertex_count, 3), len(order))
    first = order[rank < 3]
    spokes[centres[first], rank[rank < 3]] = first
    table = torch.from_numpy(spokes)
    padded = torch.cat([sharpness.repeat_interleave(2), sharpness.new_zeros(1)])
    around = padded[table[:, 1:]]
    own = torch.arange(vertex_count)[:, None]
    missing = table[:, :2] == len(order)
    rims = edges.flip(1).reshape(-1)
    ends = torch.where(missing, own, rims[table[:, :2] % max(len(order), 1)])
    two = torch.where(missing, 0, table[:, :2] // 2)
    return Sharpness(sharpness, around[:, 0], around[:, 1], two, ends)


def of_children(
    parent: Sharpness, edges: Int[Tensor, "E 2"], halves: Int[Tensor, " C"], rows: int
) -> Sharpness:
    """Return the sharpness that the halves of edges inherit.

    Args:
        parent: of a mesh.
        edges: of that mesh.
        halves: for each edge of the split mesh the parent's edge that it is half of, −1 for none.
        rows: vertices of the split mesh.
    """
    inherited = torch.where(halves >= 0, parent.edge[halves.clamp(min=0)], 0.0)
    count, edge_count = len(parent.second), len(edges)
    none = parent.edge.new_zeros(rows - count - edge_count)
    inner = torch.zeros((len(none), 2), dtype=torch.int64)
    return Sharpness(
        inherited,
        torch.cat([parent.second, parent.edge, none]),
        torch.cat([parent.third, torch.zeros_like(parent.edge), none]),
        edges=inner,  # only the ends are read at a second level
        ends=torch.cat([count + parent.edges, edges, inner]),
    )


def placed(
    smooth: sparse.csr_array,
    sharp: Sharpness,
    edges: Int[Tensor, "E 2"],
    points: Float[Tensor, "V 3"],
) -> Float[Tensor, "W 3"]:
    """Apply the masks."""
    made, count = applied(smooth, points), len(points)
    ends, w = points[edges], sharp.edge[:, None]
    at_edges = (1 - w) * made[count : count + len(edges)] + w * MIDDLE * ends.sum(dim=1)
    second, third = sharp.second[:, None], sharp.third[:, None]
    curve = CURVE_CENTRE * points + CURVE_SIDE * points[sharp.ends].sum(dim=1)
    vertices = (1 - second) * made[:count] + (second - third) * curve + third * points
    return torch.cat([vertices, at_edges, made[count + len(edges) :]])


def applied(matrix: sparse.csr_array, points: Float[Tensor, "N K"]) -> Float[Tensor, "M K"]:
    """Return matrix · points, with a gradient."""
    return _Applied.apply(points, matrix)


class _Applied(torch.autograd.Function):
    """SciPy's product: on one thread a few times as fast as torch's."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, matrix: sparse.csr_array) -> Tensor:
        ctx.matrix = matrix
        return torch.from_numpy(matrix @ points.detach().numpy())

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        back = ctx.matrix.T @ np.ascontiguousarray(gradient.numpy())
        return torch.from_numpy(back), None
