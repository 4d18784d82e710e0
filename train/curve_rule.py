"""The rule of boundaries and creases: pushes that undo what Loop's curve rule cuts off.

A curve becomes a cubic B-spline; its limit at a vertex p between a and b is p + (a + b − 2 p) / 6.
The push is that taken back, across the curve, times γ = tanh(c_v x) f(x): x = 1 − the cosine of the
turning angle, and f falls from 1 at 45 degrees to 0 at 75, since sharper corners are meant. A
vertex belongs to the curve along its two sharpest edges by w₂ − w₃.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from train.connectivity import Connectivity
from train.loop_masks import CURVE_CENTRE, CURVE_SIDE
from train.tensors import dot, unit

BEND, CORNER = (1 - math.cos(math.radians(angle)) for angle in (45, 75))


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of a mesh: boundaries, and edges of sharpness above 0 between two faces."""

    mesh: Connectivity
    points: Float[Tensor, "V 3"]

    @cached_property
    def irregular(self) -> Bool[Tensor, " E"]:
        """True for edges with neither one face nor two."""
        return ~(self.mesh.boundary | self.mesh.paired)

    @cached_property
    def at_vertices(self) -> Float[Tensor, " V"]:
        """w₂ − w₃; 0 at irregular edges."""
        _, second, third = self.mesh.sharpest[0].T
        return torch.where(self._count(self.irregular) > 0, 0.0, second - third)

    @cached_property
    def shares(self) -> Float[Tensor, " W"]:
        """Return how far each new vertex is on a curve."""
        moved = (self.at_vertices > 0)[self.mesh.edges].any(dim=1) & ~self.irregular
        return torch.cat([self.at_vertices, torch.where(moved, self.mesh.sharpness, 0.0)])

    @property
    def of_boundary(self) -> Bool[Tensor, " W"]:
        """Return which new vertices the boundary alone places."""
        alone = (self._count(self.mesh.boundary) == 2) & (self.at_vertices == 1)
        return torch.cat([alone, self.mesh.boundary])

    @cached_property
    def sides(self) -> tuple[Float[Tensor, "V 3"], Float[Tensor, "V 3"]]:
        """From each vertex to the two at its sharpest edges."""
        away = self.points[self.mesh.sharpest[1][:, :2]] - self.points[:, None]
        return away[:, 0], away[:, 1]

    @property
    def squares(self) -> Float[Tensor, " W"]:
        """h²: the mean square of both sides at a vertex, the square of the length at an edge."""
        (a, b), ends = self.sides, self.points[self.mesh.edges]
        along = ends[:, 1] - ends[:, 0]
        return torch.cat([(dot(a, a) + dot(b, b)) / 2, dot(along, along)])

    def pushes(self, gate_sharpness: float) -> Float[Tensor, "V 3"]:
        """Return d of all vertices; `gate_sharpness` is c_v."""
        return self.at_vertices[:, None] * curve_push(*self.sides, gate_sharpness)

    def prior(self, pushes: Float[Tensor, "V 3"]) -> Float[Tensor, "W 3"]:
        """Return D along the curves: the curve rules applied to pushes."""
        beside = pushes[self.mesh.sharpest[1][:, :2]].sum(dim=1)
        middle = pushes[self.mesh.edges].mean(dim=1)
        return torch.cat([CURVE_CENTRE * pushes + CURVE_SIDE * beside, middle])

    def _count(self, edges: Bool[Tensor, " E"]) -> Tensor:
        return torch.bincount(self.mesh.edges[edges].reshape(-1), minlength=self.mesh.vertex_count)


def curve_push(
    a: Float[Tensor, "V 3"], b: Float[Tensor, "V 3"], gate_sharpness: float
) -> Float[Tensor, "V 3"]:
    """Return d of vertices on curves, from the ways to both neighbours; `gate_sharpness` is c_v."""
    turning, along, middle = 1 + dot(unit(a), unit(b)), unit(b - a), (a + b) / 2
    gate = torch.tanh(gate_sharpness * turning) * (1 - corner_share(turning))
    across = middle - dot(middle, along)[:, None] * along
    return -(gate / 3)[:, None] * across


def corner_share(turning: Float[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Return how far a vertex of a curve is a corner, from 1 − the cosine of its turning angle."""
    return ((turning - BEND) / (CORNER - BEND)).clamp(0, 1)
