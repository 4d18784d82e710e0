"""A control mesh with its networks, differentiable in their weights: all that is trained.

    x₁ = S_w p + s δ     δ = (1 − w) γ Π_ρ(D + τ ℓ F z(φ)) + w Π_ρ(D_c)     D = S_w d
    x₂ = S_w x₁, with the sharpness that halves of edges inherit; then the smooth scheme

Sharpness w is a network's too. The library measures features, frames, gates and pushes once;
gradients pass through z and w, with the order of weights around vertices and s of the guard held.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pns_common import Mesh, Scheme
from pns_common.kernels.connectivity import INTERIOR
from pns_common.kernels.loop import CURVE_CENTRE, CURVE_NEIGHBOUR
from pns_common.mesh.topology import Topology
from pns_common.model.features import FEATURE_SETS
from pns_common.operator import formula
from pns_common.operator.curves import Curves, find_curves
from pns_common.operator.level import Level
from pns_common.operator.scheme import named_scheme
from pns_common.operator.sharpness import LEAST_SHARPNESS, sharpness_inputs
from pns_common.parallel import Blocks
from pns_common.refinement import control_level
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.matrix import subdivision_matrix
from train.curve_rule import curve_push
from train.data.batch import joined_meshes
from train.fitting.sharp_masks import Sharpness, around_vertices, of_children, placed
from train.models.networks import BoundedNet, Networks, SharpNet, unit_correction
from train.models.recipe import Recipe, scale_free_parts
from train.tensors import dot, shortened


@dataclass(frozen=True, eq=False)
class Inputs:
    """The surroundings of a network at N new vertices, all but its answers.

    Attributes:
        rows: their numbers among vertices, edges or faces.
        features: φ.
        axes: F, the three vectors of a ring, or a face's normal, as columns.
        gate, bound, reach: γ, ρ and τ ℓ.
    """

    rows: Int[Tensor, " N"]
    features: Float[Tensor, "N K"]
    axes: Float[Tensor, "N 3 3"]
    gate: Float[Tensor, " N"]
    bound: Float[Tensor, " N"]
    reach: Float[Tensor, " N"]

    def corrected(
        self, network: BoundedNet, prior: Float[Tensor, "M 3"], gate: Float[Tensor, " N"]
    ) -> Float[Tensor, "M 3"]:
        """Return γ Π_ρ(D + τ ℓ F z(φ)) at all M vertices, edges or faces; 0 beside these rows."""
        z = unit_correction(network)(self.features)
        turned = (self.axes[:, :, : z.shape[1]] @ z[:, :, None])[:, :, 0]
        wanted = prior[self.rows] + self.reach[:, None] * turned
        made = gate[:, None] * shortened(wanted, self.bound)
        return torch.zeros_like(prior).index_add(0, self.rows, made)


@dataclass(frozen=True, eq=False)
class LearnedLevel:
    """A control mesh and the two levels at which it has sharp edges.

    Attributes:
        level, curves: the library's, for its fold guard.
        points, edges: of the control mesh; `split_edges` of the mesh after one level.
        halves: the edge that each of those is half of, −1 for none.
        smooth, smooth_split: the scheme's smooth rules at both levels.
        on_boundary: edges that are sharp for good.
        interior: the others, by row; psi, cap: their features and the most that w can be.
        jumps, corner_edges, corner_faces: x, and the edge after each corner, and its face.
        sides: both faces of the edges of `at_edges`.
        degenerate: which of those have no frame.
        at_edges, at_vertices, at_faces: what surrounds the networks; γ of edges is their own part.
        push: d of vertices away from curves.
        numbers: of the library's rule, by name.
    """

    level: Level
    curves: Curves
    points: Float[Tensor, "V 3"]
    edges: Int[Tensor, "E 2"]
    split_edges: Int[Tensor, "E1 2"]
    halves: Int[Tensor, " E1"]
    smooth: sparse.csr_array
    smooth_split: sparse.csr_array
    on_boundary: Bool[Tensor, " E"]
    interior: Int[Tensor, " I"]
    psi: Float[Tensor, "I P"]
    cap: Float[Tensor, " I"]
    jumps: Float[Tensor, " E"]
    corner_edges: Int[Tensor, " H"]
    corner_faces: Int[Tensor, " H"]
    sides: Int[Tensor, "N 2"]
    degenerate: Bool[Tensor, " N"]
    at_edges: Inputs
    at_vertices: Inputs
    at_faces: Inputs
    push: Float[Tensor, "V 3"]
    numbers: dict[str, float]

    def logits(self, network: SharpNet) -> Float[Tensor, " I"]:
        """Return the answers of the sharpness network before the sigmoid."""
        own = network.linear_layers[0].weight.dtype
        return network(self.psi.to(own))[:, 0].double()

    def sharpness(self, logits: Float[Tensor, " I"]) -> Sharpness:
        """Return w: 1 at boundaries."""
        found = (self.cap * torch.sigmoid(logits) - LEAST_SHARPNESS).clamp(0) / (
            1 - LEAST_SHARPNESS
        )
        w = self.on_boundary.double().index_put((self.interior,), found)
        return around_vertices(self.edges, w, len(self.points))

    def smooth_sharpness(self) -> Sharpness:
        """Return w of a mesh without sharp edges but its boundary."""
        return around_vertices(self.edges, self.on_boundary.double(), len(self.points))

    def first(self, sharp: Sharpness, networks: Networks | None) -> Float[Tensor, "W 3"]:
        """Return x₁; without networks that of the base scheme, with sharp edges."""
        base = placed(self.smooth, sharp, self.edges, self.points)
        if networks is None:
            return base
        delta = self.displacement(sharp, networks)
        # Where another edge is a little sharp, the boundary places no vertex alone.
        shared = self.curves.shared.copy()
        shared[: len(self.points)] &= sharp.third.detach().numpy() == 0
        scale = formula.guard_scale(
            self.level,
            base.detach().numpy(),
            delta.detach().numpy(),
            self.numbers["fold_angle"],
            replace(self.curves, shared=shared),
        )
        return base + torch.from_numpy(scale)[:, None] * delta

    def displacement(self, sharp: Sharpness, networks: Networks) -> Float[Tensor, "W 3"]:
        """Return δ."""
        n, count = self.numbers, len(self.points)
        second, curved = sharp.second, (sharp.second - sharp.third)[:, None]
        a, b = (self.points[sharp.ends[:, k]] - self.points for k in (0, 1))
        along = n["curve"] * curved * curve_push(a, b, n["vertex_gate"])
        push = n["strength"] * (1 - second)[:, None] * self.push + along
        prior = placed(self.smooth, sharp, self.edges, push)
        ends = along[sharp.ends].sum(dim=1)
        squares = (dot(a, a) + dot(b, b)) / 2
        on_curve = shortened(CURVE_CENTRE * along + CURVE_NEIGHBOUR * ends, n["budget"] * squares)
        vertices = self.at_vertices.corrected(
            networks.vertex,
            prior[:count],
            (1 - second[self.at_vertices.rows]) * self.at_vertices.gate,
        )
        between = self.points[self.edges]
        length = between[:, 1] - between[:, 0]
        middle = shortened(along[self.edges].mean(dim=1), n["budget"] * dot(length, length))
        w = sharp.edge
        of_faces = self.face_gates((1 - w) * torch.tanh(n["vertex_gate"] * self.jumps))
        opened = torch.where(self.degenerate, 0.0, of_faces[self.sides].amin(dim=1))
        own = self.at_edges.gate
        gate = (1 - w[self.at_edges.rows]) * (own + (1 - own) * opened)
        edges = self.at_edges.corrected(networks.edge, prior[count : count + len(w)], gate)
        made = [vertices + curved * on_curve, edges + w[:, None] * middle]
        if networks.face is not None:
            made += [self.at_faces.corrected(networks.face, prior[count + len(w) :], of_faces)]
        return torch.cat(made)

    def face_gates(self, of_edges: Float[Tensor, " E"]) -> Float[Tensor, " F"]:
        """Return the largest values over the edges of each face."""
        none = of_edges.new_zeros(self.level.topology.face_count)
        return none.scatter_reduce(0, self.corner_faces, of_edges[self.corner_edges], "amax")

    def second(self, sharp: Sharpness, first: Float[Tensor, "W 3"]) -> Float[Tensor, "M 3"]:
        """Return x₂ of x₁."""
        inherited = of_children(sharp, self.edges, self.halves, len(first))
        return placed(self.smooth_split, inherited, self.split_edges, first)


def learned_level(meshes: Sequence[Mesh], recipe: Recipe) -> LearnedLevel:
    """Measure a union of meshes, each of reference length 1.

    Raises:
        ParameterError: the recipe is not scale-free.
    """
    form, vertex_rule = scale_free_parts(recipe)
    rule = formula.Rule(
        edge_network=_not_asked,
        seen=FEATURE_SETS[recipe.features],
        symmetric=True,
        gate_sharpness=recipe.gate_sharpness,
        budget=recipe.budget,
        vertex_network=_not_asked,
        vertex_gate_sharpness=vertex_rule.gate_sharpness,
        prior_strength=None,
        network_scale=form.network_scale,
    )
    unit_prior = formula.Rule(**{**vars(rule), "prior_strength": 1.0})
    mesh, scheme = joined_meshes(meshes), named_scheme(form.base)
    level = control_level(mesh, scheme, 1.0, None, threads=1)
    topology, base = level.topology, level.base
    split = base.split(topology, Blocks(), inherit=False)
    edges = topology.edges.astype(np.int64)
    at_edges = formula.edge_inputs(level, rule, topology.interior)
    at_vertices = formula.vertex_inputs(level, rule, np.flatnonzero(level.ringed))
    at_faces = formula.face_inputs(level, rule, np.arange(topology.face_count * base.polygons))
    psi, cap = _psi(meshes, scheme, vertex_rule.gate_sharpness)
    split_edges = torch.from_numpy(split.edges.astype(np.int64))
    low, high = split_edges.T
    made = high - len(mesh.vertices)
    is_half = (low < len(mesh.vertices)) & (made >= 0) & (made < len(edges))
    faces = np.arange(topology.face_count)
    return LearnedLevel(
        # Without what was measured: this travels between processes.
        level=Level(level.points, topology, level.base, 1.0, level.blocks),
        curves=find_curves(level.points, topology, split.vertex_count),
        points=torch.from_numpy(np.array(level.points)),
        edges=torch.from_numpy(edges),
        split_edges=split_edges,
        halves=torch.where(is_half, made, -1),
        smooth=sparse_matrix(topology, base),
        smooth_split=sparse_matrix(split, base),
        on_boundary=torch.from_numpy(topology.edge_class != INTERIOR),
        interior=torch.from_numpy(topology.interior.astype(np.int64)),
        psi=torch.from_numpy(psi),
        cap=torch.from_numpy(cap),
        jumps=torch.from_numpy(level.edges.jumps),
        corner_edges=torch.from_numpy(topology.corner_edges.astype(np.int64)),
        corner_faces=torch.from_numpy(np.repeat(faces, np.diff(topology.offsets))),
        sides=torch.from_numpy(topology.face_of(topology.half_edges[at_edges.rows]).astype(int)),
        degenerate=torch.from_numpy(at_edges.degenerate),
        at_edges=_inputs(at_edges),
        at_vertices=_inputs(at_vertices),
        at_faces=_inputs(at_faces),
        push=torch.from_numpy(formula.pushes(level, unit_prior)),
        numbers={
            "budget": recipe.budget,
            "strength": form.prior_strength,
            "curve": form.boundary_strength,
            "vertex_gate": vertex_rule.gate_sharpness,
            "fold_angle": math.radians(form.fold_angle),
        },
    )


def sparse_matrix(topology: Topology, base: BaseScheme) -> sparse.csr_array:
    """Return the masks of one level of a scheme."""
    made = subdivision_matrix([topology], base)
    return sparse.csr_array((made.weights, made.columns, made.starts), shape=made.shape)


def _psi(
    meshes: Sequence[Mesh], scheme: Scheme, gate_sharpness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return features and caps of sharpness; some features are those of a whole mesh."""
    levels = [control_level(mesh, scheme, 1.0, None, threads=1) for mesh in meshes]
    made = [sharpness_inputs(level, gate_sharpness)[1:] for level in levels]
    psi, cap = zip(*made, strict=True)
    return np.concatenate(psi), np.concatenate(cap)


def _inputs(at: formula.Inputs) -> Inputs:
    rows, gate = torch.from_numpy(at.rows.astype(np.int64)), torch.from_numpy(at.gate)
    axes = torch.from_numpy(at.basis).reshape(-1, 3, 3).transpose(1, 2)
    bound, reach = torch.from_numpy(at.bound), torch.from_numpy(at.reach)
    return Inputs(rows, torch.from_numpy(at.features), axes, gate, bound, reach)


def _not_asked(features: np.ndarray) -> np.ndarray:
    raise AssertionError("what surrounds a network is measured without its answers")
