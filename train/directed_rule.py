"""The rule of directed edges once more, in torch and float64: an oracle for its kernels.

Written from docs/reference and the theory, not from `pns_common`. Edge e of a mesh is read twice:
number e runs from its lower vertex a to b, number E + e runs back.

    x' = x0 + s γ Π_ρ(D + τ h F z),    D = M p − x0,    ρ = C h² / R,    x0 = S_w p
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.connectivity import next_corner
from train.models.directed import Directed
from train.reference import Surroundings
from train.tensors import dot, root, unit

# Below this length the sum of two unit normals has no direction.
NO_MEAN = 1e-3
# Where lengths in the features level off, in edges, and turns, in radians.
FAR, TURNS = 3.0, (0.3, 0.1)
SHORTEST = 1e-150

# Features (2 E, 28) → heads (2 E, 8).
DirectedNetwork = Callable[[Float[Tensor, "D 28"], Directed], Float[Tensor, "D 8"]]


@dataclass(frozen=True, eq=False)
class DirectedEdges:
    """The directed edges of a mesh with corners at points, in their frames.

    Attributes:
        around: the mesh, read without marks.
    """

    around: Surroundings

    @cached_property
    def half_edges(self) -> Int[Tensor, "D 2"]:
        """The half-edges of the faces to the left and to the right; −1 for none."""
        mesh = self.around.mesh
        edge, starts = mesh.face_edges.reshape(-1), mesh.faces.reshape(-1)
        runs_up, known = starts == mesh.edges[edge, 0], (mesh.paired | mesh.boundary)[edge]
        of_edges = torch.full((len(mesh.edges), 2), -1)
        number = torch.arange(len(starts))
        for side, chosen in enumerate((known & runs_up, known & ~runs_up)):
            of_edges[edge[chosen], side] = number[chosen]
        return torch.cat([of_edges, of_edges.flip(1)])

    @cached_property
    def ends(self) -> Int[Tensor, "D 2"]:
        """The vertices that each leaves and reaches."""
        edges = self.around.mesh.edges
        return torch.cat([edges, edges.flip(1)])

    @cached_property
    def graph(self) -> Directed:
        """The same for a network."""
        mesh, count = self.around.mesh, len(self.around.mesh.edges)
        faces = torch.where(self.half_edges[:, 0] < 0, len(mesh.faces), self.half_edges[:, 0] // 3)
        reverse = torch.arange(2 * count).roll(count)
        return Directed(*self.ends.T, reverse, faces, mesh.vertex_count, len(mesh.faces))

    @cached_property
    def along(self) -> Float[Tensor, "D 3"]:
        """b − a."""
        first, second = self.around.points[self.ends].unbind(dim=1)
        return second - first

    @cached_property
    def length(self) -> Float[Tensor, " D"]:
        """The length h."""
        return root(dot(self.along, self.along))

    @cached_property
    def normals(self) -> tuple[Float[Tensor, "D 3"], Float[Tensor, "D 3"]]:
        """Unit normals of the left and the right face; 0 without one."""
        there = self.half_edges >= 0
        made = torch.where(there[:, :, None], self.around.normals[self.half_edges // 3], 0.0)
        left, right = made.unbind(dim=1)
        return left, right

    @cached_property
    def axes(self) -> Float[Tensor, "D 3 3"]:
        """F: T, N and B as columns."""
        tangent, ends = unit(self.along), self.around.mean_normal[self.ends].sum(dim=1)
        sums = [v - dot(v, tangent)[:, None] * tangent for v in (sum(self.normals), ends)]
        clear, instead = (unit(v, NO_MEAN) for v in sums)
        normal = torch.where((dot(clear, clear) > 0)[:, None], clear, instead)
        return torch.stack([tangent, normal, torch.linalg.cross(normal, tangent)], dim=2)

    def local(self, vectors: Float[Tensor, "D 3"]) -> Float[Tensor, "D 3"]:
        """Return coordinates along T, N and B."""
        return (vectors[:, None, :] @ self.axes)[:, 0]

    def world(self, vectors: Float[Tensor, "D 3"]) -> Float[Tensor, "D 3"]:
        """Return F times vectors."""
        return (self.axes @ vectors[:, :, None])[:, :, 0]

    def in_lengths(self, vectors: Float[Tensor, "D 3"]) -> Float[Tensor, "D 3"]:
        """Return local coordinates in edge lengths; as they are where an edge has none."""
        size = torch.where(self.length > 0, self.length, 1.0)
        return self.local(vectors) / size[:, None]

    @cached_property
    def features(self) -> Float[Tensor, "D 28"]:
        """`directed-28`."""
        mesh, points, ends = self.around.mesh, self.around.points, self.ends
        across = mesh.faces.reshape(-1)[next_corner(next_corner(self.half_edges))]
        to = points[across] - points[ends].mean(dim=1, keepdim=True)
        there = (self.half_edges >= 0)[:, :, None]
        c, d = (self.in_lengths(each) for each in torch.where(there, to, 0.0).unbind(dim=1))
        umbrella, fields = self.around.umbrella[ends], self.around.mean_normal[ends]
        valence = mesh.valence[ends].clamp(min=1)
        at_border = torch.zeros(mesh.vertex_count).double()
        at_border[mesh.edges[~mesh.paired].reshape(-1)] = 1.0
        turn = self.turn(c[:, 1] + d[:, 1])[:, None]
        columns = [
            turn,
            *(torch.tanh(turn / size) for size in TURNS),
            *(_levelled(side) for side in (c, d)),
            *(self.local(fields[:, k]) for k in (0, 1)),
            *(_levelled(self.in_lengths(umbrella[:, k])) for k in (0, 1)),
            _levelled(self.length_ratio),
            (valence / 6.0).log(),
            at_border[ends],
            (~mesh.paired).double().repeat(2)[:, None],
        ]
        return torch.cat(columns, dim=1)

    def turn(self, height: Float[Tensor, " D"]) -> Float[Tensor, " D"]:
        """Return the angle between the two faces' normals, negative in valleys (`height` > 0)."""
        left, right = self.normals
        known = (dot(left, left) > 0) & (dot(right, right) > 0)
        sine = torch.linalg.cross(left, right)
        angle = torch.atan2(root(dot(sine, sine)), dot(left, right))
        return torch.where(known, torch.where(height > 0, -angle, angle), 0.0)

    @cached_property
    def length_ratio(self) -> Float[Tensor, "D 2"]:
        """log(h / mean length) around both ends."""
        sides = root(dot(self.around.spokes, self.around.spokes)).clamp(min=SHORTEST)
        means = self.around.mean(sides[:, None])[self.ends, 0]
        logs = self.length.clamp(min=SHORTEST).log()[:, None] - means.log()
        return torch.where(self.length[:, None] > 0, logs, 0.0)

    def mean_leaving(self, values: Float[Tensor, "D K"]) -> Float[Tensor, "V K"]:
        """Return means over the directed edges that leave each vertex."""
        return self.graph.mean(values)

    def over_edges(self, values: Float[Tensor, "D K"]) -> Float[Tensor, "E K"]:
        """Return means over both directions of each edge."""
        return torch.stack(values.chunk(2)).mean(dim=0)


def _levelled(values: Tensor) -> Tensor:
    return FAR * torch.tanh(values / FAR)
