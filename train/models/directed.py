"""The network of directed edges: states, rounds of messages, and linear heads.

Each directed edge of the control mesh has a state of W numbers, made of its features. In each round
it hears its own state, that of the reverse edge, and the mean and the largest state of the edges
that leave its first and its second vertex. The heads are linear in the last state: z of the new
vertex and y of the vertex that the edge leaves, in the edge's frame; logits of sharpness, of the
edge and of the vertex; over Catmull–Clark also a height, whose mean around a face is its vertex's.

All hidden units come in pairs that the mirror c ↔ d exchanges (``tied``), and means and largest
values go by unit, so a mirrored mesh has the mirrored answer for any weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from pns_common.mesh.topology import Topology
from pns_common.model.features import DIRECTED_28, Symmetries
from train.models.networks import _seeded_linear
from train.models.tied import _Invariant, _Repeated, _tie, _TiedFirst, _TiedHidden, _TiedLast

# What a message is made of: own state, reverse edge's, and two of each end's pool.
PARTS = 6
# D of the heads under the mirror: z and y in T, N, B, two logits; and a face's height.
MIRRORED = (1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0)
# The heads begin near flat triangles and smooth edges.
HEAD_SIZE, SMOOTH = 0.01, -2.0
SHARPNESS = 6


@dataclass(frozen=True, eq=False)
class Directed:
    """The directed edges of a mesh: number e runs from the lower end of edge e, number E + e back.

    Attributes:
        first, second: (2 E,) the vertices that they leave and reach.
        reverse: (2 E,) the same edge backwards.
        left: (2 E,) the face to the left; F where there is none.
        vertices, faces: how many there are.
    """

    first: Int[Tensor, " D"]
    second: Int[Tensor, " D"]
    reverse: Int[Tensor, " D"]
    left: Int[Tensor, " D"]
    vertices: int
    faces: int

    @classmethod
    def of(cls, mesh: Topology) -> Directed:
        """Return the directed edges of a topology."""
        edges, count = mesh.edges.astype(np.int64), len(mesh.edges)
        left = np.full(2 * count, mesh.face_count)
        runs_up = mesh.edges[mesh.corner_edges, 0] == mesh.corners
        number = mesh.corner_edges + np.where(runs_up, 0, count)
        left[number] = mesh.face_of(np.arange(len(mesh.corners)))
        made = edges.T.reshape(-1), edges[:, ::-1].T.reshape(-1)
        made += np.roll(np.arange(2 * count), count), left
        return cls(*map(torch.from_numpy, made), mesh.vertex_count, mesh.face_count)

    @property
    def beside_border(self) -> Bool[Tensor, " D"]:
        """True for edges between two faces that leave a vertex of the border."""
        open_edges = (self.left == self.faces) | (self.left[self.reverse] == self.faces)
        border = torch.zeros(self.vertices, dtype=torch.bool)
        border[self.first[open_edges]] = True
        return border[self.first] & ~open_edges

    def mean(self, values: Float[Tensor, "D K"]) -> Float[Tensor, "V K"]:
        """Return the mean over the edges that leave each vertex; 0 where none does."""
        ones = torch.ones(len(values), 1, dtype=values.dtype)
        total, count = (self._sum(each) for each in (values, ones))
        return total / count.clamp(min=1)

    def _sum(self, values: Float[Tensor, "D K"]) -> Float[Tensor, "V K"]:
        none = torch.zeros(self.vertices, values.shape[1], dtype=values.dtype)
        return none.index_add(0, self.first, values)

    def largest(self, values: Float[Tensor, "D K"]) -> Float[Tensor, "V K"]:
        """Return the largest over the edges that leave each vertex; 0 where none does."""
        none = torch.zeros(self.vertices, values.shape[1], dtype=values.dtype)
        where = self.first[:, None].expand(-1, values.shape[1])
        return none.scatter_reduce(0, where, values, "amax", include_self=False)

    def mean_in_faces(self, values: Float[Tensor, "D K"]) -> Float[Tensor, "F K"]:
        """Return the mean over both directions of the edges around each face.

        A mirror puts the face to the left of the other direction.
        """
        values = (values + values[self.reverse]) / 2
        none = torch.zeros(self.faces + 1, values.shape[1], dtype=values.dtype)
        count = torch.bincount(self.left, minlength=self.faces + 1).clamp(min=1)
        return (none.index_add(0, self.left, values) / count[:, None])[: self.faces]


class DirectedNet(nn.Module):
    """States of directed edges, and their heads.

    Attributes:
        encoder, rounds, heads: perceptrons of one hidden layer, and a linear layer.
    """

    def __init__(
        self,
        generator: torch.Generator,
        width: int = 16,
        hidden: int = 32,
        rounds: int = 2,
        *,
        faces: bool = False,
    ):
        super().__init__()
        self.width, self.hidden, self.faces = width, hidden, faces
        group = DIRECTED_28.symmetries
        size = len(group.order)
        self.encoder = _perceptron((DIRECTED_28.count, hidden, width), generator)
        _tie(self.encoder[0], _TiedFirst(group), _Repeated(size))
        _tie(self.encoder[2], _TiedHidden(size), _Repeated(size))
        made = [_perceptron((PARTS * width, hidden, width), generator) for _ in range(rounds)]
        for first, _, second in made:  # type: ignore[misc]
            _tie(first, _TiedHidden(size, PARTS), _Repeated(size))
            _tie(second, _TiedHidden(size), _Repeated(size))
        self.rounds = nn.ModuleList(made)
        local = np.array([np.ones(len(MIRRORED) + faces), [*MIRRORED, *[1.0] * faces]])
        answers = Symmetries(group.order, group.signs, local)
        self.heads = _seeded_linear(width, local.shape[1], generator)
        with torch.no_grad():
            self.heads.weight.normal_(0.0, HEAD_SIZE, generator=generator)
            self.heads.bias.zero_()
            self.heads.bias[SHARPNESS : SHARPNESS + 2] = SMOOTH
        _tie(self.heads, _TiedLast(answers), _Invariant(answers))

    def forward(self, features: Float[Tensor, "D 28"], mesh: Directed) -> Float[Tensor, "D A"]:
        """Return the answers of all directed edges."""
        return self.heads(self.states(features, mesh))

    def states(self, features: Float[Tensor, "D 28"], mesh: Directed) -> Float[Tensor, "D W"]:
        """Return the last states."""
        state = self.encoder(features)
        for update in self.rounds:
            pooled = torch.cat([mesh.mean(state), mesh.largest(state)], dim=1)
            parts = state, state[mesh.reverse], pooled[mesh.first], pooled[mesh.second]
            state = state + update(torch.cat(parts, dim=1))
        return state


def _perceptron(widths: tuple[int, int, int], generator: torch.Generator) -> nn.Sequential:
    first, second = (_seeded_linear(*pair, generator) for pair in pairwise(widths))
    return nn.Sequential(first, nn.SiLU(), second)
