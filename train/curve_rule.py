"""The rule of boundaries and creases: pushes that undo what Loop's curve rule cuts off.

A curve becomes a cubic B-spline; its limit at a vertex p between a and b is p + (a + b − 2 p) / 6.
The push is that taken back, across the curve, times γ = tanh(c_v x) f(x): x = 1 − the cosine of the
turning angle, and f falls from 1 at 60 degrees to 0 at 90, since sharper corners are meant.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from train.connectivity import Connectivity
from train.tensors import dot, unit

BEND, CORNER = 1 / 2, 1.0


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of a mesh: boundaries, and edges of sharpness 1 between two faces."""

    mesh: Connectivity
    points: Float[Tensor, "V 3"]

    @property
    def edges(self) -> Bool[Tensor, " E"]:
        """Whether an edge is one of a curve."""
        return self.mesh.boundary | (self.mesh.paired & (self.mesh.sharpness >= 1))

    @cached_property
    def movable(self) -> Bool[Tensor, " V"]:
        """Whether a vertex lies on exactly two edges of curves, and on no other of sharpness 1."""
        return (self._count(self.edges) == 2) & (self._count(self.mesh.sharpness >= 1) == 2)

    @property
    def moved(self) -> Bool[Tensor, " W"]:
        """Whether a new vertex lies on a curve near a movable vertex."""
        at_edges = self.edges & self.movable[self.mesh.edges].any(dim=1)
        return torch.cat([self.movable, at_edges])

    @property
    def of_boundary(self) -> Bool[Tensor, " W"]:
        """Whether the boundary alone places a new vertex."""
        creases = self._count(self.edges & ~self.mesh.boundary) > 0
        return torch.cat([self.movable & ~creases, self.mesh.boundary])

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
        """Return d of all vertices, 0 where they are not movable; `gate_sharpness` is c_v."""
        return self.movable[:, None] * curve_push(*self.sides, gate_sharpness)

    def _count(self, edges: Bool[Tensor, " E"]) -> Tensor:
        return torch.bincount(self.mesh.edges[edges].reshape(-1), minlength=self.mesh.vertex_count)


def curve_push(
    a: Float[Tensor, "V 3"], b: Float[Tensor, "V 3"], gate_sharpness: float
) -> Float[Tensor, "V 3"]:
    """Return d of vertices on curves, from the ways to both neighbours; `gate_sharpness` is c_v."""
    turning, along, middle = 1 + dot(unit(a), unit(b)), unit(b - a), (a + b) / 2
    fade = ((CORNER - turning) / (CORNER - BEND)).clamp(0, 1)
    gate = torch.tanh(gate_sharpness * turning) * fade
    across = middle - dot(middle, along)[:, None] * along
    return -(gate / 3)[:, None] * across
