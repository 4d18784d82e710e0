"""Masks with sharpness, differentiable in it: blends of smooth rules, of curves, and of staying.

    edge vertex     (1 − w) smooth + w middle
    old vertex      (1 − w₂) smooth + (w₂ − w₃) curve(edges 1, 2) + w₃ p

w₁ ≥ w₂ ≥ w₃ … are the weights around a vertex, each as κ + (1 − κ) w with its corner weight κ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.loop_masks import CURVE_CENTRE, CURVE_SIDE, MIDDLE
from train.models.directed import Directed

# Limit of a point on a curve: of itself, and of each neighbour along the curve.
LIMIT_CENTRE, LIMIT_SIDE = 2 / 3, 1 / 6
SHARPEST = 3


@dataclass(frozen=True, eq=False)
class Spokes:
    """The sharpest edges around each vertex.

    Attributes:
        second, third: w₂ and w₃, corners included; `own_third`: w₃ of edges alone.
        ends: the other ends of the two sharpest edges; the vertex itself where it has fewer.
        numbers: these directed edges; −1 where it has fewer. Empty but at the control mesh.
    """

    second: Float[Tensor, " V"]
    third: Float[Tensor, " V"]
    own_third: Float[Tensor, " V"]
    ends: Int[Tensor, "V 2"]
    numbers: Int[Tensor, "V 2"]

    @classmethod
    def of(cls, directed: Directed, w: Float[Tensor, " E"], corners: Float[Tensor, " V"]) -> Spokes:
        """Return those of a control mesh; at a border's vertices the border's edges alone."""
        count, first = len(directed.first), directed.first.numpy()
        both = torch.where(directed.beside_border, 0.0, torch.cat([w, w]))
        order = np.lexsort((-both.detach().numpy(), first))
        centres = first[order]
        rank = np.arange(count) - np.searchsorted(centres, centres)
        table = np.full((directed.vertices, SHARPEST), count)
        kept = rank < SHARPEST
        table[centres[kept], rank[kept]] = order[kept]
        spokes = torch.from_numpy(table)
        own = torch.cat([both, w.new_zeros(1)])[spokes]
        around = corners[:, None] + (1 - corners[:, None]) * own
        numbers = torch.where(spokes[:, :2] == count, -1, spokes[:, :2])
        ends = _or_itself(numbers, directed.second[numbers.clamp(min=0)])
        return cls(around[:, 1], around[:, 2], own[:, 2], ends, numbers)

    def of_split(self, w: Float[Tensor, " E"], edges: Int[Tensor, "E 2"], rows: int) -> Spokes:
        """Return those after one level, of `rows` vertices."""
        count, number = len(self.second), len(edges)
        ends = _or_itself(self.numbers, count + self.numbers.clamp(min=0) % number)
        return self._inherited([w], [ends, edges], rows - count - number)

    def of_last(
        self,
        w: Float[Tensor, " E"],
        halves: Float[Tensor, " E1"],
        edges: Int[Tensor, "E 2"],
        split_edges: Int[Tensor, "E1 2"],
        children: Int[Tensor, "E 2"],
        counts: tuple[int, int],
    ) -> Spokes:
        """Return those after two levels, of counts[1] vertices; counts[0] are after one.

        Args:
            w, halves: sharpness of both meshes' edges.
            edges, split_edges: these edges.
            children: both halves of each of the first.
            counts: vertices after one level and two.
        """
        number, number_split = len(edges), len(split_edges)
        spoke = self.numbers.clamp(min=0)
        child = children[spoke % number, (spoke >= number).long()]
        ends = _or_itself(self.numbers, counts[0] + child)
        inner = counts[0] - len(self.second) - number
        none = w.new_zeros(inner)
        still = torch.zeros((inner, 2), dtype=torch.int64)
        tables = [ends, counts[0] + children, still, split_edges]
        return self._inherited([w, none, halves], tables, counts[1] - counts[0] - number_split)

    def _inherited(self, sharpness: list[Tensor], ends: list[Tensor], inner: int) -> Spokes:
        """Return spokes with new vertices, each on one sharp edge, then some on none."""
        second = torch.cat([self.second, *sharpness, self.second.new_zeros(inner)])
        third = torch.cat([self.third, self.third.new_zeros(len(second) - len(self.third))])
        table = torch.cat([*ends, torch.zeros((inner, 2), dtype=torch.int64)])
        return Spokes(second, third, third, table, table[:0])


@dataclass(frozen=True, eq=False)
class Masks:
    """A scheme's smooth rules at one level, as a sparse matrix; `limit`: its limit masks."""

    smooth: sparse.csr_array
    limit: bool = False

    def __call__(
        self,
        points: Float[Tensor, "V 3"],
        spokes: Spokes,
        w: Float[Tensor, " E"] | None = None,
        edges: Int[Tensor, "E 2"] | None = None,
    ) -> Float[Tensor, "W 3"]:
        """Apply the masks; those of a level want the edges and their sharpness."""
        made, count = applied(self.smooth, points), len(points)
        centre, side = (LIMIT_CENTRE, LIMIT_SIDE) if self.limit else (CURVE_CENTRE, CURVE_SIDE)
        second, third = spokes.second[:, None], spokes.third[:, None]
        curve = centre * points + side * points[spokes.ends].sum(dim=1)
        vertices = (1 - second) * made[:count] + (second - third) * curve + third * points
        if w is None or edges is None:
            return vertices
        middle = MIDDLE * points[edges].sum(dim=1)
        at_edges = (1 - w)[:, None] * made[count : count + len(edges)] + w[:, None] * middle
        return torch.cat([vertices, at_edges, made[count + len(edges) :]])


def _or_itself(numbers: Int[Tensor, "V 2"], ends: Int[Tensor, "V 2"]) -> Int[Tensor, "V 2"]:
    return torch.where(numbers < 0, torch.arange(len(numbers))[:, None], ends)


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
