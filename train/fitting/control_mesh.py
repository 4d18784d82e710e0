"""A control mesh with a network of directed edges, differentiable in its weights.

    x₁ = S_w p + s γ Π_ρ(M p − S_w p + τ h F z)       M splits flat: middles, and old vertices p
    x₂ = S_w x₁,  then the limit masks                 w of edges and κ of vertices are inherited

The library measures features, frames, bounds and gates once; gradients pass through z, w and κ,
with the order of weights around vertices and s of the fold guard held.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import Mesh
from pns_common.kernels import directed as kernels
from pns_common.kernels.connectivity import INTERIOR
from pns_common.mesh.mesh import fans
from pns_common.mesh.topology import Topology
from pns_common.operator import formula
from pns_common.operator.curves import corner_shares, curve_prior, curve_pushes, find_curves
from pns_common.operator.directed import DirectedNetworks, directed_features
from pns_common.operator.level import Level
from pns_common.operator.scheme import named_scheme
from pns_common.operator.sharpness import LEAST_SHARPNESS
from pns_common.parallel import Blocks
from pns_common.refinement import control_level
from pns_common.schemes.limit import limit_positions
from pns_common.schemes.matrix import Place, mask_matrix
from train.fitting.soft_masks import Masks, Spokes
from train.models.directed import Directed, DirectedNet
from train.models.recipe import DirectedForm
from train.tensors import shortened


def _unasked(rows: np.ndarray) -> np.ndarray:
    raise AssertionError("what surrounds a network is measured without its answers")


_NONE = DirectedNetworks(_unasked, (), _unasked, 0, 0)


@dataclass(frozen=True, eq=False)
class Limit:
    """Points of the limit surface, at the vertices after two levels, and what led to them.

    Attributes:
        points: limit positions.
        sharpness, corners: w of edges and κ of vertices.
        guarded: share of new vertices that the guard scaled.
    """

    points: Float[Tensor, "M 3"]
    sharpness: Float[Tensor, " E"]
    corners: Float[Tensor, " V"]
    guarded: float


class ControlMesh:
    """A mesh of reference length 1 with all that surrounds a network of directed edges.

    Attributes:
        faces: triangles after two levels.
    """

    def __init__(self, mesh: Mesh, rule: DirectedForm):
        level = control_level(mesh, named_scheme(rule.base), 1.0, None, threads=1).unmarked
        level.measure(rings=True)
        self.rule, self.base = rule, level.base
        topology, points = level.topology, np.array(level.points)
        self.points, self.edges = torch.from_numpy(points), _long(topology.edges)
        self.directed = Directed.of(topology)
        self.features = torch.from_numpy(by_way(directed_features(level, 0, len(topology.edges))))
        self.axes = torch.from_numpy(_axes(level))
        split = self.base.split(topology, Blocks(), inherit=False)
        self._measure_gates(level, split.vertex_count)
        self._measure_boundary(level, split.vertex_count)
        last = self.base.split(split, Blocks(), inherit=False)
        self.faces: Int[np.ndarray, "T 3"] = last.corners[fans(last.offsets)[0]].astype(np.int64)
        self.masks = (
            Masks(_matrix(topology, self.base.place)),
            Masks(_matrix(split, self.base.place)),
            Masks(_matrix(last, partial(limit_positions, base=self.base)), limit=True),
        )
        self.split_edges = _long(split.edges)
        self.halves, self.children = _halves(self.edges, self.split_edges, len(points))
        self.counts = split.vertex_count, last.vertex_count
        # For the guard alone, without what was measured.
        self.level = Level(level.points, topology, level.base, 1.0, level.blocks)

    def _measure_gates(self, level: Level, rows: int) -> None:
        mesh, rule = level.topology, self.rule
        jumps = level.edges.jumps
        of_edges = np.tanh(rule.vertex_gate_sharpness * jumps)
        self.interior = torch.from_numpy(mesh.edge_class == INTERIOR)
        self.ringed = torch.from_numpy(np.array(level.ringed))
        self.edge_gate = torch.from_numpy(of_edges)
        self.own_gate = torch.from_numpy(np.tanh(rule.gate_sharpness * jumps**2))
        self.corner_edges, self.corners = _long(mesh.corner_edges), _long(mesh.corners)
        self.corner_faces = torch.from_numpy(
            np.repeat(np.arange(mesh.face_count), np.diff(mesh.offsets))
        )
        half = np.where(mesh.half_edges >= 0, mesh.half_edges, 0)
        self.sides = _long(mesh.face_of(half.reshape(-1)).reshape(-1, 2))
        given = rule.gate_sharpness, rule.vertex_gate_sharpness, rule.budget
        given += rule.curve_strength, rule.network_scale, rule.fold_angle
        whole = formula.DirectedRule(_NONE, *given)
        around = formula.surroundings(level, whole, np.zeros((rows, 3)))
        self.flat = torch.from_numpy(around.flat)
        self.moved = torch.zeros(rows, 1, dtype=torch.float64)
        firsts = 0, len(level.points), len(level.points) + len(mesh.edges)
        for first, at in zip(firsts, around.rows, strict=True):
            self.moved[_long(at) + first] = 1.0
        # Those of vertices and edges are for all, in their order.
        self.bound = torch.from_numpy(np.concatenate(around.bounds))
        self.reach = rule.network_scale * torch.from_numpy(np.concatenate(around.lengths))
        self.face_normals = torch.from_numpy(level.normals.copy())

    def _measure_boundary(self, level: Level, rows: int) -> None:
        """Measure what the boundary does by itself: displacements, corners, what it shares."""
        mesh, rule, count = level.topology, self.rule, len(level.points)
        curves = self.curves = find_curves(level.points, mesh, rows)
        pushes = rule.curve_strength * curve_pushes(curves, rule.vertex_gate_sharpness)
        along = torch.from_numpy(curve_prior(curves, pushes))
        made = shortened(along, torch.from_numpy(rule.budget * curves.squares))
        made *= torch.from_numpy(curves.shares)[:, None]
        self.on_boundary = torch.zeros(rows, 3, dtype=torch.float64)
        self.on_boundary[_long(curves.new_rows)] = made
        self.corner = torch.zeros(count, dtype=torch.float64)
        self.corner[_long(curves.rows)] = torch.from_numpy(corner_shares(curves))

    def limit(self, network: DirectedNet | None) -> Limit:
        """Return the limit surface; without a network the base scheme's."""
        count, interior = len(self.points), self.interior
        if network is None:
            w, corners = (~interior).double(), torch.zeros(count, dtype=torch.float64)
            spokes = Spokes.of(self.directed, w, corners)
            first, guarded = self.masks[0](self.points, spokes, w, self.edges), 0.0
            return Limit(self._limit_of(first, spokes, w), w, corners, guarded)
        heads = network(self.features, self.directed).double()
        there, back = heads.tensor_split(2)
        logits = (there[:, kernels.SHARPNESS] + back[:, kernels.SHARPNESS]) / 2
        w = torch.where(interior, _share(logits, self.edge_gate), 1.0)
        of_faces = self._largest(self.edge_gate, self.corner_edges, self.corner_faces)
        around = self._largest(of_faces, self.corner_faces, self.corners, count)
        own = _share(self.directed.mean(heads[:, [kernels.CORNER]])[:, 0], around)
        corners = torch.where(self.ringed, own, self.corner)
        spokes = Spokes.of(self.directed, w, corners)
        base = self.masks[0](self.points, spokes, w, self.edges)
        delta = self._displacement(heads, w, base)
        scale = formula.guard_scale(
            self.level,
            base.detach().numpy(),
            np.ascontiguousarray(delta.detach().numpy()),
            math.radians(self.rule.fold_angle),
            self.curves,
        )
        first = base + torch.from_numpy(scale)[:, None] * delta
        return Limit(self._limit_of(first, spokes, w), w, corners, float((scale < 1).mean()))

    def _displacement(
        self, heads: Tensor, w: Tensor, base: Float[Tensor, "W 3"]
    ) -> Float[Tensor, "W 3"]:
        turned, leaving = (
            torch.einsum("dk,dkj->dj", heads[:, first : first + 3], self.axes)
            for first in (kernels.EDGE, kernels.VERTEX)
        )
        asked = [self.directed.mean(leaving), sum(turned.tensor_split(2)) / 2]
        if self.base.polygons:
            height = self.directed.mean_in_faces(heads[:, [kernels.FACE]])
            asked.append(height * self.face_normals)
        one = torch.ones((), dtype=torch.float64)
        wanted = self.flat - base + self.reach[:, None] * shortened(torch.cat(asked), one)
        made = self._gates(w)[:, None] * shortened(wanted, self.bound)
        return self.moved * made + self.on_boundary

    def _gates(self, w: Float[Tensor, " E"]) -> Float[Tensor, " W"]:
        """Return γ of all new vertices: 0 on planes, and in flat faces within sharp edges."""
        of_edges = torch.where(self.interior, (1 - w) * self.edge_gate, 0.0)
        of_faces = self._largest(of_edges, self.corner_edges, self.corner_faces)
        of_vertices = self._largest(of_faces, self.corner_faces, self.corners, len(self.points))
        of_sides = of_faces[self.sides]
        most, least, own = of_sides.amax(dim=1), of_sides.amin(dim=1), self.own_gate
        bent = own * (1 - w + w * most) + (1 - own) * least
        return torch.cat([of_vertices, bent, *([of_faces] if self.base.polygons else [])])

    def _largest(
        self, values: Tensor, at: Int[Tensor, " H"], to: Int[Tensor, " H"], count: int | None = None
    ) -> Tensor:
        none = values.new_zeros(int(self.corner_faces[-1]) + 1 if count is None else count)
        return none.scatter_reduce(0, to, values[at], "amax")

    def _limit_of(
        self, first: Float[Tensor, "W 3"], spokes: Spokes, w: Float[Tensor, " E"]
    ) -> Float[Tensor, "M 3"]:
        """Return the limit positions of the vertices after two levels."""
        second = torch.where(self.halves >= 0, w[self.halves.clamp(min=0)], 0.0)
        split = spokes.of_split(w, self.edges, self.counts[0])
        made = self.masks[1](first, split, second, self.split_edges)
        last = spokes.of_last(w, second, self.edges, self.split_edges, self.children, self.counts)
        return self.masks[2](made, last)


def _share(logits: Tensor, gate: Tensor) -> Tensor:
    """Return w of logits, exactly 0 where it would be less than the least sharpness."""
    return (gate * torch.sigmoid(logits) - LEAST_SHARPNESS).clamp(min=0) / (1 - LEAST_SHARPNESS)


def _axes(level: Level) -> Float[np.ndarray, "D 3 3"]:
    """Return T, N, B of each directed edge: what the library makes of unit answers."""
    mesh, count = level.topology, len(level.topology.edges)
    heads, made = np.zeros((3, 2 * count, kernels.FACE)), np.empty((3, 2 * count, 3))
    for axis in range(3):
        heads[axis, :, kernels.VERTEX + axis] = 1.0
        read = level.points, level.normals, level.rings.fields, mesh.connectivity, heads[axis]
        kernels.read_heads(0, count, *read, np.empty((count, 3)), made[axis], np.empty(count))
    return by_way(np.ascontiguousarray(made.transpose(1, 0, 2)))


def by_way(rows: Float[np.ndarray, "D ..."]) -> Float[np.ndarray, "D ..."]:
    """Return the library's rows of directed edges as networks here read them: all a → b first."""
    return np.concatenate([rows[0::2], rows[1::2]])


def _halves(
    edges: Int[Tensor, "E 2"], split_edges: Int[Tensor, "E1 2"], count: int
) -> tuple[Int[Tensor, " E1"], Int[Tensor, "E 2"]]:
    """Return the edge that each edge of the split mesh is half of, −1 for none; and both halves."""
    low, high = split_edges.T
    edge = high - count
    is_half = (low < count) & (edge >= 0) & (edge < len(edges))
    rows = torch.nonzero(is_half)[:, 0]
    parents = edge[rows]
    children = torch.zeros_like(edges)
    children[parents, (edges[parents, 0] != low[rows]).long()] = rows
    return torch.where(is_half, edge, -1), children


def _matrix(topology: Topology, place: Place) -> sparse.csr_array:
    """Return masks as a matrix: those of one level, or those that lead to the limit surface."""
    made = mask_matrix(topology, place, Blocks())
    return sparse.csr_array((made.weights, made.columns, made.starts), shape=made.shape)


def _long(array: np.ndarray) -> Int[Tensor, "..."]:
    return torch.from_numpy(array.astype(np.int64))
