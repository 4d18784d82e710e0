"""The rule of directed edges once more, in torch and float64: an oracle for its kernels.

Written from the formula and docs/reference, not from the kernels of `pns_common`. Edge e of a mesh
is read twice: number e runs from its lower vertex a to b, number E + e runs back.

    x' = x0 + s γ Π_ρ(D + τ h F z),    D = M p − x0,    x0 = S_w p,    ρ = C h² / R

M p are corners and middles of edges; w, the sharpness of edges and corners, is learned as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property

import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.connectivity import Connectivity, next_corner
from train.curve_rule import Curves, corner_share
from train.loop_masks import loop_points
from train.models.directed import Directed
from train.reference import Step, Surroundings, fold_guard
from train.tensors import dot, root, shortened, unit

# Below this length the sum of two unit normals has no direction.
NO_MEAN = 1e-3
# Where lengths in the features level off, in edges, and turns, in radians.
FAR, TURNS = 3.0, (0.3, 0.1)
SHORTEST = 1e-150
# Smaller weights count as 0; learned ones stay below 1.
LEAST_WEIGHT, MOST_WEIGHT = 1e-5, 1 - 2.0**-52

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
        """The directed edges as a network reads them."""
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
        turn = self.turn(c[:, 1] + d[:, 1])[:, None]
        columns = [
            turn,
            *(torch.tanh(turn / size) for size in TURNS),
            *(_levelled(side) for side in (c, d)),
            *(self.local(fields[:, k]) for k in (0, 1)),
            *(_levelled(self.in_lengths(umbrella[:, k])) for k in (0, 1)),
            _levelled(self.length_ratio),
            (valence / 6.0).log(),
            self.at_border[ends],
            (~mesh.paired).double().repeat(2)[:, None],
        ]
        return torch.cat(columns, dim=1)

    @cached_property
    def at_border(self) -> Float[Tensor, " V"]:
        """1 at vertices on an edge without two faces."""
        mesh = self.around.mesh
        made = torch.zeros(mesh.vertex_count).double()
        made[mesh.edges[~mesh.paired].reshape(-1)] = 1.0
        return made

    @property
    def jumps(self) -> Float[Tensor, " E"]:
        """x = 1 − n₁ · n₂; 0 at edges without two faces."""
        return self.around.jumps

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


@dataclass(frozen=True, eq=False)
class Sharpened(Connectivity):
    """A mesh whose vertices have corner weights κ beside the sharpness of its edges.

    Attributes:
        corners: κ.
        marked: what of the edges' sharpness is not learned: all that counts at a border's vertices.
    """

    corners: Float[Tensor, " V"]
    marked: Float[Tensor, " E"]

    @cached_property
    def sharpest(self) -> tuple[Float[Tensor, "V 3"], Int[Tensor, "V 3"]]:
        """κ + (1 − κ) w of the three sharpest edges around each vertex, and their rims."""
        given = {each.name: getattr(self, each.name) for each in fields(Connectivity)}
        as_marked = Connectivity(**{**given, "sharpness": self.marked})
        border = torch.zeros(self.vertex_count, dtype=torch.bool)
        border[self.edges[self.boundary].reshape(-1)] = True
        pairs = zip(as_marked.sharpest, super().sharpest, strict=True)
        weights, rims = (torch.where(border[:, None], ends, all_) for ends, all_ in pairs)
        kappa = self.corners[:, None]
        return kappa + (1 - kappa) * weights, rims


@dataclass(frozen=True)
class DirectedRule:
    """The operator of format 5 at its learned level, over Loop.

    Attributes:
        network: answers of directed edges: z, y, and the logits of sharpness and of corners.
        budget: C.
        gate_sharpness, vertex_gate_sharpness: c and c_v.
        curve_strength: of the prior along boundaries and marked creases.
        network_scale: τ.
        fold_angle: θ, degrees.
    """

    network: DirectedNetwork
    budget: float
    gate_sharpness: float
    vertex_gate_sharpness: float
    curve_strength: float
    network_scale: float
    fold_angle: float

    def __call__(
        self, points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float = 1.0
    ) -> Step:
        """Take the learned step; ``mesh`` has what is marked as sharp."""
        unmarked = replace(mesh, sharpness=(~mesh.paired).double())
        edges, one = DirectedEdges(Surroundings(unmarked, points)), points.new_ones(())
        heads = self.network(edges.features, edges.graph)
        sharpened = self.sharpened(mesh, edges, heads)
        base, middle = loop_points(points, sharpened), points[mesh.edges].mean(dim=1)
        vertices = edges.mean_leaving(edges.world(heads[:, 3:6]))
        between = edges.over_edges(edges.world(heads[:, :3]))
        squares = torch.cat([edges.around.square[:, 0], dot(*[edges.along[: len(middle)]] * 2)])
        asked = shortened(torch.cat([vertices, between]), one)
        wanted = torch.cat([points, middle]) - base
        wanted = wanted + self.network_scale * root(squares)[:, None] * asked
        marks = replace(mesh, sharpness=mesh.sharpness.floor())
        ringed = mesh.ringed & (marks.sharpest[0][:, 1] < 1)
        acts = torch.cat([ringed, mesh.paired & (mesh.sharpness < 1)])
        gate = acts * torch.cat(self.gates(sharpened, edges.jumps))
        curves = Curves(marks, points)
        pushes = self.curve_strength * curves.pushes(self.vertex_gate_sharpness)
        unit_budget, share = self.budget / reference_length, curves.shares
        envelope, on_curve = unit_budget * squares * acts, unit_budget * curves.squares
        displacement = gate[:, None] * shortened(wanted, envelope)
        along = shortened(curves.prior(pushes), on_curve)
        displacement = displacement + share[:, None] * along
        envelope = (1 - share) * envelope + share * on_curve
        scale = fold_guard(mesh.split(), base, displacement, self.fold_angle, curves.of_boundary)
        return Step(base, displacement, envelope, gate, scale)

    def sharpened(
        self, mesh: Connectivity, edges: DirectedEdges, heads: Float[Tensor, "D 8"]
    ) -> Sharpened:
        """Return the mesh with learned sharpness and corners where they are more than marked."""
        unmarked = edges.around.mesh
        gate = torch.tanh(self.vertex_gate_sharpness * edges.jumps)
        w = _clearly(gate * torch.sigmoid(edges.over_edges(heads[:, 6:7]))[:, 0])
        w = torch.maximum(mesh.sharpness, w.clamp(max=MOST_WEIGHT))
        inside, _ = self.gates(unmarked, edges.jumps)
        kappa = _clearly(inside * torch.sigmoid(edges.mean_leaving(heads[:, 7:8]))[:, 0])
        border, curves = edges.at_border > 0, Curves(unmarked, edges.around.points)
        a, b = curves.sides
        turned = (curves.at_vertices > 0) * corner_share(1 + dot(unit(a), unit(b)))
        given = {field.name: getattr(mesh, field.name) for field in fields(Connectivity)}
        given |= {"sharpness": w, "corners": torch.where(border, turned, kappa)}
        return Sharpened(**given, marked=mesh.sharpness)

    def gates(
        self, mesh: Connectivity, jumps: Float[Tensor, " E"]
    ) -> tuple[Float[Tensor, " V"], Float[Tensor, " E"]]:
        """Return γ of vertices and edges.

        γ_f = max (1 − w) tanh(c_v x) over a face's edges; γ_v = max γ_f around a vertex; γ_e is
        1 − w (1 − the larger γ_f) by γ₂ = tanh(c x²), and the smaller γ_f by 1 − γ₂.
        """
        of_edges = (1 - mesh.sharpness) * torch.tanh(self.vertex_gate_sharpness * jumps)
        opened = of_edges[mesh.face_edges].max(dim=1).values.repeat_interleave(3)
        edge = mesh.face_edges.reshape(-1)
        none, every = torch.zeros_like(jumps), torch.ones_like(jumps)
        most, least = none.scatter_reduce(0, edge, opened, "amax"), every
        least = least.scatter_reduce(0, edge, opened, "amin")
        vertices = jumps.new_zeros(mesh.vertex_count)
        vertices = vertices.scatter_reduce(0, mesh.faces.reshape(-1), opened, "amax")
        bent = torch.tanh(self.gate_sharpness * jumps**2)
        return vertices, bent * (1 - mesh.sharpness * (1 - most)) + (1 - bent) * least


def _clearly(weights: Tensor) -> Tensor:
    """Return weights of which those below the least are 0, without a jump."""
    return (weights - LEAST_WEIGHT).clamp(min=0) / (1 - LEAST_WEIGHT)
