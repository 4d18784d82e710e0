"""What surrounds the networks of a scale-free rule on one mesh: constants while they are trained.

    x' = x0 + s γ Π_ρ(D + τ h F z(φ))

The library measures all but z once; gradients pass through z, with s of the fold guard held.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import Mesh, loop, operator
from pns_common.curves import Curves, find_curves
from pns_common.level import Level
from pns_common.refinement import control_level
from train.models.networks import BoundedNet, unit_correction
from train.models.recipe import Recipe, scale_free_parts
from train.tensors import shortened


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
        level, curves: the library's, for its fold guard.
        base: x0, old vertices first.
        on_curves: what is added at boundaries, whatever the networks answer.
        edges, vertices: what surrounds both networks.
        pushed: x0 with the whole prior: quasi-interpolation along the normal.
        fold_angle: θ, radians.
    """

    level: Level
    curves: Curves
    base: Float[Tensor, "W 3"]
    on_curves: Float[Tensor, "W 3"]
    edges: Inputs
    vertices: Inputs
    pushed: Float[Tensor, "W 3"]
    fold_angle: float

    def points(self, network: BoundedNet, vertex_network: BoundedNet) -> Float[Tensor, "W 3"]:
        """Return x', with gradients to both networks."""
        made = self.on_curves
        for part, net in ((self.edges, network), (self.vertices, vertex_network)):
            made = made.index_add(0, part.rows, part.displacement(net))
        scale = operator.guard_scale(
            self.level, self.base.numpy(), made.detach().numpy(), self.fold_angle, self.curves
        )
        return self.base + torch.from_numpy(scale)[:, None] * made


def learned_level(mesh: Mesh, recipe: Recipe) -> LearnedLevel:
    """Measure a mesh at reference length 1, with the prior's strength of training.

    Raises:
        ParameterError: the recipe is not scale-free.
    """
    form, vertex_rule, strength = scale_free_parts(recipe)
    rule = operator.Rule(
        edge_network=_not_asked,
        feature_count=18,
        symmetric=True,
        gate_sharpness=recipe.gate_sharpness,
        budget=recipe.budget,
        vertex_network=_not_asked,
        vertex_gate_sharpness=vertex_rule.gate_sharpness,
        prior_strength=strength,
        curve_strength=form.boundary_strength,
        network_scale=form.network_scale,
        fold_angle=form.fold_angle,
    )
    level = control_level(mesh, loop(), 1.0, None, threads=1)
    topology, count = level.topology, len(mesh.vertices)
    curves = find_curves(level.points, topology)
    prior = torch.from_numpy(operator.prior(level, rule, curves))
    base = level.base.place(level.points, topology, level.blocks)
    pushed = base + level.base.place(
        operator.pushes(level, rule) / strength, topology, level.blocks
    )
    on_curves, rows = torch.zeros_like(prior), torch.from_numpy(curves.new_rows)
    bound = recipe.budget * torch.from_numpy(curves.squares)
    on_curves[rows] = shortened(prior[rows], bound)
    edges = operator.edge_inputs(level, rule, topology.interior)
    vertices = operator.vertex_inputs(level, rule, np.flatnonzero(level.ringed))
    # Without what was measured: this travels between processes.
    bare = Level(level.points, topology, level.base, 1.0, level.blocks)
    return LearnedLevel(
        level=bare,
        curves=curves,
        base=torch.from_numpy(base),
        on_curves=on_curves,
        edges=_inputs(edges, count, prior),
        vertices=_inputs(vertices, 0, prior),
        pushed=torch.from_numpy(pushed),
        fold_angle=math.radians(form.fold_angle),
    )


def _inputs(at: operator.Inputs, first: int, prior: Float[Tensor, "W 3"]) -> Inputs:
    rows = torch.from_numpy(first + at.rows.astype(np.int64))
    gate = torch.from_numpy(at.weight * at.gate)
    axes = torch.from_numpy(at.basis).reshape(-1, 3, 3).transpose(1, 2)
    bound, reach = torch.from_numpy(at.bound), torch.from_numpy(at.reach)
    return Inputs(rows, torch.from_numpy(at.features), axes, gate, bound, reach, prior[rows])


def _not_asked(features: np.ndarray) -> np.ndarray:
    raise AssertionError("what surrounds a network is measured without its answers")
