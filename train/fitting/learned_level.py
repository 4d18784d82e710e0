"""What surrounds the networks of a scale-free rule on one mesh: constants while they are trained.

    x' = x0 + s γ Π_ρ(D + τ h F z(φ))

All but z is measured once; gradients pass through z, with s of the fold guard held.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pns_common import Mesh
from train.connectivity import connect
from train.curve_rule import Curves
from train.loop_masks import loop_mask
from train.models.networks import BoundedNet, unit_correction
from train.models.recipe import Recipe, ScaleFree, VertexRule, scale_free_parts
from train.reference import (
    Surroundings,
    edge_frames,
    fold_guard,
    pushes,
    read_edges,
    ring_10,
    ring_vectors,
    signed_18,
)
from train.tensors import root, shortened


@dataclass(frozen=True, eq=False)
class Inputs:
    """What surrounds a network at N new vertices, all but its answers.

    Attributes:
        rows: their numbers in the refined mesh.
        features: φ.
        axes: F, or the three vectors of a ring, as columns.
        gate, bound, reach: γ, ρ and τ h.
        prior: D.
    """

    rows: Int[Tensor, " N"]
    features: Float[Tensor, "N K"]
    axes: Float[Tensor, "N 3 3"]
    gate: Float[Tensor, " N"]
    bound: Float[Tensor, " N"]
    reach: Float[Tensor, " N"]
    prior: Float[Tensor, "N 3"]

    def displacement(self, network: BoundedNet) -> Float[Tensor, "N 3"]:
        """Return δ = γ Π_ρ(D + τ h F z(φ))."""
        z = unit_correction(network)(self.features)
        wanted = self.prior + self.reach[:, None] * (self.axes @ z[:, :, None])[:, :, 0]
        return self.gate[:, None] * shortened(wanted, self.bound)


@dataclass(frozen=True, eq=False)
class LearnedLevel:
    """A control mesh before its learned level.

    Attributes:
        base: x0, old vertices first.
        on_curves: what is added at boundaries, whatever the networks answer.
        edges, vertices: what surrounds both networks.
        faces: of the split mesh.
        of_boundary: new vertices that the boundary alone places.
        pushed: x0 with the whole prior: quasi-interpolation along the normal.
        fold_angle: θ, degrees.
    """

    base: Float[Tensor, "W 3"]
    on_curves: Float[Tensor, "W 3"]
    edges: Inputs
    vertices: Inputs
    faces: Int[Tensor, "C 3"]
    of_boundary: Bool[Tensor, " W"]
    pushed: Float[Tensor, "W 3"]
    fold_angle: float

    def points(self, network: BoundedNet, vertex_network: BoundedNet) -> Float[Tensor, "W 3"]:
        """Return x', with gradients to both networks."""
        made = self.on_curves
        for part, net in ((self.edges, network), (self.vertices, vertex_network)):
            made = made.index_add(0, part.rows, part.displacement(net))
        scale = fold_guard(self.faces, self.base, made, self.fold_angle, self.of_boundary)
        return self.base + scale[:, None] * made


def learned_level(mesh: Mesh, recipe: Recipe) -> LearnedLevel:
    """Measure a mesh at reference length 1, with the prior's strength of training.

    Raises:
        ParameterError: the recipe is not scale-free.
    """
    form, vertex_rule, strength = scale_free_parts(recipe)
    level, points = connect(mesh.faces, len(mesh.vertices)), torch.tensor(mesh.vertices)
    around, curves, masks = Surroundings(level, points), Curves(level, points), loop_mask(level)
    of_curves = form.boundary_strength * curves.pushes(vertex_rule.gate_sharpness)
    prior, base = masks(strength * pushes(around) + of_curves), masks(points)
    bound = torch.where(curves.moved, recipe.budget * curves.squares, 0.0)
    return LearnedLevel(
        base=base,
        on_curves=shortened(masks(of_curves), bound),
        edges=_edge_inputs(around, prior, recipe, form),
        vertices=_vertex_inputs(around, prior, recipe, form, vertex_rule),
        faces=level.split(),
        of_boundary=curves.of_boundary,
        pushed=base + masks(pushes(around)),
        fold_angle=form.fold_angle,
    )


def _edge_inputs(
    around: Surroundings, prior: Float[Tensor, "W 3"], recipe: Recipe, form: ScaleFree
) -> Inputs:
    edges, mesh = read_edges(around, first_face=False), around.mesh
    frames, rows = edge_frames(edges, first_face=False), mesh.interior
    length, curvature = frames.length[rows], frames.curvature[rows]
    return Inputs(
        rows=mesh.vertex_count + rows,
        features=signed_18(around, edges, frames)[rows],
        axes=frames.axes[rows],
        gate=torch.tanh(recipe.gate_sharpness * curvature**2),
        bound=recipe.budget * length**2,
        reach=form.network_scale * length,
        prior=prior[mesh.vertex_count + rows],
    )


def _vertex_inputs(
    around: Surroundings,
    prior: Float[Tensor, "W 3"],
    recipe: Recipe,
    form: ScaleFree,
    rule: VertexRule,
) -> Inputs:
    rows, jump = torch.nonzero(around.mesh.ringed)[:, 0], around.mean(around.turns[0])[:, 0]
    square = around.square[rows, 0]
    return Inputs(
        rows=rows,
        features=ring_10(around)[rows],
        axes=ring_vectors(around)[rows],
        gate=torch.tanh(rule.gate_sharpness * jump[rows]),
        bound=recipe.budget * square,
        reach=form.network_scale * root(square),
        prior=prior[rows],
    )
