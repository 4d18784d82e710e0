"""The operator with one part taken out at a time: which property does each part protect?

Each variant is another function; the operator itself has no switch for any of this. Source: paper,
Structural certification and ablation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import msgspec
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import Scheme
from train.connectivity import Connectivity
from train.data.batch import Batch
from train.fitting.trainer import Fit, optimise, step_loss, with_quiet
from train.models.networks import RAW_COORDINATES, BoundedNet, unit_correction
from train.models.recipe import Recipe, one_step
from train.reference import (
    EdgeReading,
    Frames,
    Step,
    Surroundings,
    edge_frames,
    on_edges,
    paper_5,
    read_edges,
)
from train.refining import torch_rule
from train.tensors import shortened


@dataclass(frozen=True, eq=False)
class Seen:
    """Interior edges of a mesh, with the operator's envelope C h² / R and gate of all edges.

    The envelope is also that of variants that know none: proximity ratios are measured against it.
    """

    edges: EdgeReading
    frames: Frames
    rows: Int[Tensor, " I"]
    features: Float[Tensor, "I 5"]
    envelope: Float[Tensor, " E"]
    gate: Float[Tensor, " E"]

    def turned(self, local: Float[Tensor, "I 3"]) -> Float[Tensor, "E 3"]:
        """Return F times local vectors of interior edges, 0 at other edges."""
        world = (self.frames.axes[self.rows] @ local[:, :, None])[:, :, 0]
        return torch.zeros_like(self.edges.a).index_copy(0, self.rows, world)


# What a variant adds to Loop's edge vertices: from edges, the network, and C / R.
EdgeCorrection = Callable[[Seen, BoundedNet, float], Float[Tensor, "E 3"]]


@dataclass(frozen=True, slots=True)
class Variant:
    """A trainable edge rule. `features` replaces the recipe's."""

    name: str
    features: str
    correction: EdgeCorrection
    gated: bool = True


def see(points: Float[Tensor, "V 3"], mesh: Connectivity, recipe: Recipe, budget: float) -> Seen:
    """Look at the edges of a mesh; `budget` is C / R."""
    around, rows = Surroundings(mesh, points), mesh.interior
    edges = read_edges(around, first_face=True)
    frames = edge_frames(edges, first_face=True)
    inside = torch.zeros(len(mesh.edges), dtype=torch.float64).index_fill(0, rows, 1.0)
    gate = inside * torch.tanh(recipe.gate_sharpness * frames.curvature**2)
    features = paper_5(around, edges, frames)[rows]
    return Seen(edges, frames, rows, features, budget * inside * frames.length**2, gate)


def paper_correction(seen: Seen, network: BoundedNet, budget: float) -> Float[Tensor, "E 3"]:
    """Return the operator's own δ = h² γ F η."""
    return (seen.envelope * seen.gate)[:, None] * seen.turned(_bounded(seen, network))


def without_gate(seen: Seen, network: BoundedNet, budget: float) -> Float[Tensor, "E 3"]:
    """Return δ = h² F η: planar input is no longer left alone."""
    return seen.envelope[:, None] * seen.turned(_bounded(seen, network))


def without_square(seen: Seen, network: BoundedNet, budget: float) -> Float[Tensor, "E 3"]:
    """Return δ = h γ F η: proximity of first order only.

    The published "no h² scaling" variant keeps one power of h: with none, its weights miss their
    published numbers by far.
    """
    reach = budget * seen.frames.length * seen.gate
    return reach[:, None] * seen.turned(_bounded(seen, network))


def without_bound(seen: Seen, network: BoundedNet, budget: float) -> Float[Tensor, "E 3"]:
    """Return δ = h² γ F z: the network's answer is not projected onto the ball."""
    reach = seen.frames.length**2 * seen.gate
    return reach[:, None] * seen.turned(_raw_output(network, seen.features))


def unconstrained(seen: Seen, network: BoundedNet, budget: float) -> Float[Tensor, "E 3"]:
    """Return δ = z(a, b, c, d): an offset from raw coordinates, with no structure at all."""
    edges = seen.edges
    corners = torch.cat([edges.a, edges.b, edges.c, edges.d], dim=1)[seen.rows]
    offset = _raw_output(network, corners)
    return torch.zeros_like(edges.a).index_copy(0, seen.rows, offset)


PNS = Variant("pns", "paper-5", paper_correction)
WITHOUT_SQUARE = Variant("no-h2", "paper-5", without_square)
WITHOUT_GATE = Variant("no-gate", "paper-5", without_gate, gated=False)
WITHOUT_BOUND = Variant("unbounded", "paper-5", without_bound)
UNCONSTRAINED = Variant("unconstrained", RAW_COORDINATES, unconstrained, gated=False)

VARIANTS: Mapping[str, Variant] = {
    variant.name: variant
    for variant in (PNS, WITHOUT_SQUARE, WITHOUT_GATE, WITHOUT_BOUND, UNCONSTRAINED)
}


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


def variant_step(
    variant: Variant,
    network: BoundedNet,
    recipe: Recipe,
    points: Float[Tensor, "V 3"],
    mesh: Connectivity,
    reference_length: float = 1.0,
) -> Step:
    """Take one step of a variant, with Loop's vertex rule."""
    budget = recipe.budget / reference_length
    seen = see(points, mesh, recipe, budget)
    made = variant.correction(seen, network, budget)
    gate = seen.gate if variant.gated else torch.zeros_like(seen.gate)
    return on_edges(points, mesh, made, seen.envelope, gate)


def fit_variant(variant: Variant, recipe: Recipe) -> Fit:
    """Train a variant by a recipe of its own."""

    def loss(network: BoundedNet, batch: Batch) -> Float[Tensor, ""]:
        step = variant_step(variant, network, recipe, batch.points, batch.mesh)
        return step_loss(recipe, batch, step)

    return optimise(recipe, with_quiet(recipe, loss), lambda done, loss: None)


def variant_scheme(variant: Variant, network: BoundedNet, recipe: Recipe) -> Scheme:
    """Return a variant as a scheme; ratios are against its C h²."""

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        return variant_step(variant, network, recipe, points, mesh, reference_length)

    return Scheme(variant.name, rule=torch_rule(step), learned_levels=None)


def _bounded(seen: Seen, network: BoundedNet) -> Float[Tensor, "I 3"]:
    eta = unit_correction(network)(seen.features)
    return shortened(eta, torch.ones(len(eta), dtype=torch.float64))


def _raw_output(network: BoundedNet, inputs: Float[Tensor, "N K"]) -> Float[Tensor, "N 3"]:
    own = network.linear_layers[0].weight.dtype
    return network.raw(inputs.to(own)).to(inputs.dtype)
