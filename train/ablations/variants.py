"""The operator with one part taken out at a time: which property does each part protect?

Each variant is another function, built from the operator's own kernels; the operator itself has no
switch for any of this. Source: paper, Structural certification and ablation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import msgspec
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pns_common.features.edge_features import FEATURE_SETS
from pns_common.formula.correction import Correction, correct, curvature_gate, proximity_ratio
from pns_common.geometry.frames import (
    EdgeStencil,
    edge_frames,
    edge_stencil,
    face_normals,
    rotate,
)
from pns_common.schemes import ControlLevel, Placement, Scheme, loop_edge_rule, loop_vertex_rule
from train.data.batch import Batch
from train.fitting.one_step import displaced
from train.fitting.trainer import Fit, OnStep, optimise, step_loss, with_quiet
from train.models.networks import RAW_COORDINATES, BoundedNet, unit_correction
from train.models.recipe import Recipe, one_step

# Interior edges, the network, its recipe and C / R to what is added to Loop's edge vertices.
#
# The envelope C h² of the answer is the operator's own, also where the variant knows none: it is
# what the proximity ratio is measured against.
EdgeCorrection = Callable[[EdgeStencil, BoundedNet, Recipe, float], Correction]


@dataclass(frozen=True, slots=True)
class Variant:
    """A trainable edge rule. `features` replaces the recipe's."""

    name: str
    features: str
    correction: EdgeCorrection


def paper_correction(
    stencil: EdgeStencil, network: BoundedNet, recipe: Recipe, budget: float
) -> Correction:
    """Return the operator's own δ = h² γ F η."""
    gate = curvature_gate(recipe.gate_sharpness)
    return correct(stencil, FEATURE_SETS[recipe.features], unit_correction(network), gate, budget)


def without_gate(
    stencil: EdgeStencil, network: BoundedNet, recipe: Recipe, budget: float
) -> Correction:
    """Return δ = h² F η: planar input is no longer left alone."""

    def open_gate(curvature: Float[Tensor, " N"]) -> Float[Tensor, " N"]:
        return torch.ones_like(curvature)

    return correct(
        stencil, FEATURE_SETS[recipe.features], unit_correction(network), open_gate, budget
    )


def without_square(
    stencil: EdgeStencil, network: BoundedNet, recipe: Recipe, budget: float
) -> Correction:
    """Return δ = h γ F η: proximity of first order only.

    The published "no h² scaling" variant keeps one power of h: with none, its weights miss their
    published numbers by far.
    """
    reference, frames = paper_correction(stencil, network, recipe, budget), edge_frames(stencil)
    eta = unit_correction(network)(FEATURE_SETS[recipe.features](stencil, frames))
    reach = budget * frames.length * reference.gate
    return replace(reference, displacement=reach[:, None] * rotate(frames, eta))


def without_bound(
    stencil: EdgeStencil, network: BoundedNet, recipe: Recipe, budget: float
) -> Correction:
    """Return δ = h² γ F z: the network's answer is not projected onto the ball."""
    reference, frames = paper_correction(stencil, network, recipe, budget), edge_frames(stencil)
    z = _raw_output(network, FEATURE_SETS[recipe.features](stencil, frames))
    reach = frames.length**2 * reference.gate
    return replace(reference, displacement=reach[:, None] * rotate(frames, z))


def unconstrained(
    stencil: EdgeStencil, network: BoundedNet, recipe: Recipe, budget: float
) -> Correction:
    """Return δ = z(a, b, c, d): an offset from raw coordinates, with no structure at all."""
    frames = edge_frames(stencil)
    return Correction(
        displacement=_raw_output(
            network, torch.cat([stencil.a, stencil.b, stencil.c, stencil.d], dim=-1)
        ),
        envelope=budget * frames.length**2,
        gate=torch.zeros_like(frames.length),
        degenerate=torch.zeros_like(frames.degenerate),
    )


PNS = Variant("pns", "paper-5", paper_correction)
WITHOUT_SQUARE = Variant("no-h2", "paper-5", without_square)
WITHOUT_GATE = Variant("no-gate", "paper-5", without_gate)
WITHOUT_BOUND = Variant("unbounded", "paper-5", without_bound)
UNCONSTRAINED = Variant("unconstrained", RAW_COORDINATES, unconstrained)

VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {
        variant.name: variant
        for variant in (PNS, WITHOUT_SQUARE, WITHOUT_GATE, WITHOUT_BOUND, UNCONSTRAINED)
    }
)


def variant_recipe(recipe: Recipe, variant: Variant) -> Recipe:
    """Return a recipe under which a variant is trained; it differs in name and inputs only.

    The unconstrained network has a third hidden layer, as the published one, and no quiet term: it
    sees no features.
    """
    if variant.features == RAW_COORDINATES:
        return replace(
            recipe,
            name=variant.name,
            features=RAW_COORDINATES,
            hidden=(32, 32, 32),
            training=msgspec.structs.replace(one_step(recipe), quiet=0.0),
        )
    return replace(recipe, name=variant.name)


def fit_variant(variant: Variant, recipe: Recipe, on_step: OnStep) -> Fit:
    """Train a variant; for `PNS` this is the operator's own training, bit for bit."""

    def loss(network: BoundedNet, batch: Batch) -> Float[Tensor, ""]:
        edges = _edges(batch.points, batch)
        correction = variant.correction(edges, network, recipe, recipe.budget)
        ratio = proximity_ratio(correction)
        step = displaced(batch.points, batch.topology, correction.displacement, ratio)
        return step_loss(recipe, batch, step)

    return optimise(recipe, with_quiet(recipe, loss), on_step)


def variant_scheme(variant: Variant, network: BoundedNet, recipe: Recipe) -> Scheme:
    """Return a variant as a scheme, with Loop's vertex rule; ratios are against its C h²."""

    def edge_rule(level: ControlLevel) -> Placement:
        base, topology = loop_edge_rule(level), level.topology
        if level.reference_length == 0:
            return base
        interior = topology.interior
        stencil, faces = topology.stencil[interior], topology.edge_faces[interior]
        stencils = edge_stencil(
            torch.tensor(level.points), torch.tensor(level.normals), stencil, faces
        )
        with torch.no_grad():
            correction = variant.correction(
                stencils, network, recipe, recipe.budget / float(level.reference_length)
            )
        return Placement(
            loop=base.loop,
            displacement=_scattered(correction.displacement.numpy(), interior, len(base.loop)),
            ratio=_scattered(proximity_ratio(correction).numpy(), interior, len(base.loop)),
            gate=_scattered(correction.gate.numpy(), interior, len(base.loop)),
            degenerate=_scattered(correction.degenerate.numpy(), interior, len(base.loop)),
        )

    return Scheme(variant.name, loop_vertex_rule, edge_rule, budget=recipe.budget)


def _edges(points: Float[Tensor, "V 3"], batch: Batch) -> EdgeStencil:
    topology = batch.topology
    interior = topology.interior
    normals = face_normals(points, topology.faces)
    return edge_stencil(points, normals, topology.stencil[interior], topology.edge_faces[interior])


def _raw_output(network: BoundedNet, inputs: Float[Tensor, "N K"]) -> Float[Tensor, "N 3"]:
    own = network.linear_layers[0].weight.dtype
    return network.raw(inputs.to(own)).to(inputs.dtype)


def _scattered(rows: np.ndarray, indices: np.ndarray, count: int) -> np.ndarray:
    """Return an array of `count` rows that holds `rows` at `indices` and zeros elsewhere."""
    whole = np.zeros((count, *rows.shape[1:]), dtype=rows.dtype)
    whole[indices] = rows
    return whole
