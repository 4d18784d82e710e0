"""The operator once more, in torch: gradients through positions, and an oracle for the kernels.

Written from the paper and from the derivations behind docs/explanation/guarantees.md, not from
`pns_common`: it finds edges by itself, sums in any order, and runs at a thousandth of the kernels'
speed. All is float64. Symbols are those of docs/reference/features.md; a, b, c, d are an edge's
ends and opposite vertices.

    q  = q0 + h² γ (C / R) F Π₁ η(φ)

This is format 1; `directed_rule` is format 5.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from train.connectivity import Connectivity
from train.loop_masks import loop_points
from train.tensors import dot, ratio, root, shortened, unit

# Below these a face has no area (of its squared sides), faces are antiparallel (1 + cosine), and a
# side's logarithm is cut off.
NO_AREA, ANTIPARALLEL, SHORTEST = 1e-12, 1e-6, 1e-150
# The guard gives up after so many halvings; a child may not shrink below this share of its area.
ROUNDS, LEAST_AREA = 30, 1e-3

# Features (N, K) -> local vectors (N, 3).
Network = Callable[[Tensor], Tensor]


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Measurements of a mesh with corners at `points`."""

    mesh: Connectivity
    points: Float[Tensor, "V 3"]

    def mean(self, spokes: Float[Tensor, "S K"]) -> Float[Tensor, "V K"]:
        """Return means over the spokes of each vertex."""
        total = self.points.new_zeros((self.mesh.vertex_count, spokes.shape[1]))
        total = total.index_add(0, self.mesh.centres, spokes)
        return total / self.mesh.valence.clamp(min=1)[:, None]

    @cached_property
    def area_vectors(self) -> Float[Tensor, "F 3"]:
        """(b − a) × (c − a) of each face."""
        a, b, c = (self.points[corner] for corner in self.mesh.faces.T)
        return torch.linalg.cross(b - a, c - a)

    @cached_property
    def normals(self) -> Float[Tensor, "F 3"]:
        """Unit normals of faces; 0 without area."""
        a, b, c = (self.points[corner] for corner in self.mesh.faces.T)
        return unit(self.area_vectors, NO_AREA * (dot(b - a, b - a) + dot(c - a, c - a)))

    @cached_property
    def mean_normal(self) -> Float[Tensor, "V 3"]:
        """m_v = Σ area vectors / Σ their lengths."""
        corners, size = self.mesh.faces.T.reshape(-1), root(dot(*[self.area_vectors] * 2))
        both = torch.cat([self.area_vectors, size[:, None]], dim=1).repeat(3, 1)
        total = self.points.new_zeros((self.mesh.vertex_count, 4)).index_add(0, corners, both)
        return ratio(total[:, :3], total[:, 3:])

    @cached_property
    def spokes(self) -> Float[Tensor, "S 3"]:
        """p_j − p_v."""
        return self.points[self.mesh.rims] - self.points[self.mesh.centres]

    @cached_property
    def umbrella(self) -> Float[Tensor, "V 3"]:
        """u_v = mean of p_j − p_v."""
        return self.mean(self.spokes)

    @cached_property
    def square(self) -> Float[Tensor, "V 1"]:
        """h_v² = mean of ‖p_j − p_v‖²."""
        return self.mean(dot(self.spokes, self.spokes)[:, None])

    @cached_property
    def height(self) -> Float[Tensor, "V 1"]:
        """u_v · m_v / h_v; 0 at edges that are sharp for good."""
        lean = dot(self.umbrella, self.mean_normal)[:, None]
        return (self.mesh.sharpest[0][:, :1] < 1) * ratio(lean, root(self.square))

    @cached_property
    def jumps(self) -> Float[Tensor, " E"]:
        """x = ‖n − n'‖² / 2 of each edge; 0 at edges sharp for good."""
        edges = read_edges(self, first_face=False)
        whole = (dot(edges.n1, edges.n1) > 0) & (dot(edges.n2, edges.n2) > 0)
        apart = edges.n1 - edges.n2
        return torch.where(whole & (self.mesh.sharpness < 1), dot(apart, apart) / 2, 0.0)


@dataclass(frozen=True, eq=False)
class EdgeReading:
    """All E edges as they are read: vertices' numbers, points, and normals of c's and d's faces."""

    vertices: Int[Tensor, "E 4"]
    a: Float[Tensor, "E 3"]
    b: Float[Tensor, "E 3"]
    c: Float[Tensor, "E 3"]
    d: Float[Tensor, "E 3"]
    n1: Float[Tensor, "E 3"]
    n2: Float[Tensor, "E 3"]


def read_edges(around: Surroundings, *, first_face: bool) -> EdgeReading:
    """Read c in the face of lower index, or else in the face that runs from a to b.

    Edges without two faces read a in place of c and d, and no normals.
    """
    mesh = around.mesh
    sides, faces = mesh.opposites, mesh.half_edges // 3
    if not first_face:
        runs = mesh.faces.reshape(-1)[mesh.half_edges[:, :1]] == mesh.edges[:, :1]
        sides, faces = (torch.where(runs, two, two.flip(1)) for two in (sides, faces))
    vertices = torch.cat([mesh.edges, sides], dim=1)
    normals = torch.where(mesh.paired[:, None, None], around.normals[faces], 0.0)
    points = around.points[vertices].unbind(dim=1)
    return EdgeReading(vertices, *points, *normals.unbind(dim=1))


@dataclass(frozen=True, eq=False)
class Frames:
    """F = [T, N, B] with its columns as (E, 3, 3)[:, :, k], h, and x = 1 − n₁ · n₂."""

    axes: Float[Tensor, "E 3 3"]
    length: Float[Tensor, " E"]
    curvature: Float[Tensor, " E"]
    degenerate: Bool[Tensor, " E"]


def edge_frames(edges: EdgeReading, *, first_face: bool) -> Frames:
    """Return frames (section 3.2); degenerate ones are the world's triad.

    There x is 0, but for the paper's reading also 2 between antiparallel faces.
    """
    along, cosine = edges.b - edges.a, dot(edges.n1, edges.n2)
    length = root(dot(along, along))
    undefined = (length == 0) | (dot(edges.n1, edges.n1) == 0) | (dot(edges.n2, edges.n2) == 0)
    degenerate = undefined | (cosine <= -1 + ANTIPARALLEL)
    triad = torch.eye(3, dtype=torch.float64)
    tangent = torch.where(degenerate[:, None], triad[0], unit(along))
    mean = torch.where(degenerate[:, None], triad[1], edges.n1 + edges.n2)
    normal = unit(mean - dot(mean, tangent)[:, None] * tangent)
    axes = torch.stack([tangent, normal, torch.linalg.cross(tangent, normal)], dim=2)
    no_curvature = undefined if first_face else degenerate
    return Frames(axes, length, torch.where(no_curvature, 0.0, 1 - cosine), degenerate)


def paper_5(around: Surroundings, edges: EdgeReading, frames: Frames) -> Float[Tensor, "E 5"]:
    """Return x and the logarithms of ac, bc, ad, bd over h."""
    sides = (edges.c - edges.a, edges.c - edges.b, edges.d - edges.a, edges.d - edges.b)
    logs = [root(dot(side, side)).clamp(min=SHORTEST).log() for side in sides]
    over = frames.length.clamp(min=SHORTEST).log()
    return torch.stack([frames.curvature, *(log - over for log in logs)], dim=1)


def signed_18(around: Surroundings, edges: EdgeReading, frames: Frames) -> Float[Tensor, "E 18"]:
    """Return those of `paper-5`, the dihedral, the tilts of ends and wings, and the umbrellas."""
    tangent, binormal = frames.axes[:, :, 0], frames.axes[:, :, 2]
    tilts = around.mean_normal[edges.vertices]
    two = [(tilts[:, pair], axis) for pair in ([0, 1], [2, 3]) for axis in (tangent, binormal)]
    return torch.cat(
        [
            paper_5(around, edges, frames),
            dot(torch.linalg.cross(edges.n1, edges.n2), tangent)[:, None],
            *(dot(tilt, axis[:, None]) for tilt, axis in two),
            around.height[edges.vertices, 0],
        ],
        dim=1,
    )


EDGE_FEATURES = {"paper-5": paper_5, "signed-18": signed_18}


@dataclass(frozen=True, eq=False)
class Step:
    """One step, old vertices first: x0, δ before the guard, ρ, γ, and s of the guard."""

    base: Float[Tensor, "W 3"]
    displacement: Float[Tensor, "W 3"]
    envelope: Float[Tensor, " W"]
    gate: Float[Tensor, " W"]
    scale: Float[Tensor, " W"]

    @property
    def points(self) -> Float[Tensor, "W 3"]:
        """x' = x0 + s δ."""
        return self.base + self.scale[:, None] * self.displacement

    @property
    def ratio(self) -> Float[Tensor, " W"]:
        """The proximity ratio s ‖δ‖ / ρ; 0 where ρ is 0."""
        length = root(dot(self.displacement, self.displacement))
        return self.scale * ratio(length, self.envelope)


def on_edges(
    points: Float[Tensor, "V 3"],
    mesh: Connectivity,
    displacement: Float[Tensor, "E 3"],
    envelope: Float[Tensor, " E"],
    gate: Float[Tensor, " E"],
) -> Step:
    """Return Loop's step with something added to edge vertices."""
    none = points.new_zeros(mesh.vertex_count)
    return Step(
        loop_points(points, mesh),
        torch.cat([torch.zeros_like(points), displacement]),
        torch.cat([none, envelope]),
        torch.cat([none, gate]),
        points.new_ones(mesh.vertex_count + len(mesh.edges)),
    )


@dataclass(frozen=True)
class PaperRule:
    """The operator of format 1: C, c, its features, and the network at budget 1."""

    network: Network
    budget: float
    gate_sharpness: float
    features: Callable[[Surroundings, EdgeReading, Frames], Tensor] = paper_5
    first_face: bool = True

    def __call__(
        self, points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float = 1.0
    ) -> Step:
        """Take one step; old vertices are Loop's."""
        around = Surroundings(mesh, points)
        edges = read_edges(around, first_face=self.first_face)
        frames = edge_frames(edges, first_face=self.first_face)
        interior = mesh.paired & (mesh.sharpness < 1)
        gate = (1 - mesh.sharpness) * torch.tanh(self.gate_sharpness * frames.curvature**2)
        eta = self.network(self.features(around, edges, frames)[interior])
        local = torch.zeros_like(edges.a).index_put((interior,), shortened(eta, gate.new_ones(())))
        envelope = self.budget / reference_length * frames.length**2 * interior
        turned = (frames.axes @ local[:, :, None])[:, :, 0]
        return on_edges(points, mesh, (envelope * gate)[:, None] * turned, envelope, gate)


def fold_guard(
    faces: Int[Tensor, "C 3"],
    base: Float[Tensor, "W 3"],
    displacement: Float[Tensor, "W 3"],
    angle: float,
    of_boundary: Bool[Tensor, " W"],
) -> Float[Tensor, " W"]:
    """Return s: halved at the corners of all faces that turn by more than `angle`, until none do.

    Vertices `of_boundary` are halved only by faces that they would fold by themselves, so that two
    meshes still meet there. Gradients stop here.
    """
    base, displacement, scale = base.detach(), displacement.detach(), torch.ones(len(base)).double()
    halvings = 0
    while True:
        folded = faces[_turned(faces, base, scale[:, None] * displacement, angle)]
        by_itself = torch.where(of_boundary, scale, 0.0)[:, None] * displacement
        alone = _turned(folded, base, by_itself, angle)
        corners = folded[alone[:, None] | ~of_boundary[folded]]
        corners = corners[scale[corners] > 0]
        if len(corners) == 0:
            return scale
        scale[corners] = scale[corners] / 2 if halvings < ROUNDS else 0.0
        halvings += 1


def _turned(
    faces: Int[Tensor, "C 3"], base: Float[Tensor, "W 3"], added: Float[Tensor, "W 3"], angle: float
) -> Bool[Tensor, " C"]:
    """Return whether a face with area turned by more than an angle, or lost nearly all its area."""
    before, after = (_area_vectors(faces, points) for points in (base, base + added))
    sides = [base[faces[:, corner]] - base[faces[:, 0]] for corner in (1, 2)]
    least = NO_AREA * (dot(sides[0], sides[0]) + dot(sides[1], sides[1]))
    old, new, cosine = dot(before, before), dot(after, after), math.cos(math.radians(angle))
    kept = (dot(before, after) >= cosine * (old * new).sqrt()) & (new >= LEAST_AREA**2 * old)
    return (old > least**2) & ~kept


def _area_vectors(faces: Int[Tensor, "C 3"], points: Float[Tensor, "W 3"]) -> Tensor:
    a, b, c = (points[corner] for corner in faces.T)
    return torch.linalg.cross(b - a, c - a)
