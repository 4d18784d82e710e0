"""What a recipe makes of edges and vertices: its untrained networks, and their rules."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import torch

from pns_common.errors import ParameterError
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.feature_set import FeatureSet
from pns_common.features.orientation import ORIENTATIONS
from pns_common.features.ring_features import RING_FEATURE_SETS, RingFeatureSet
from pns_common.formula.correction import curvature_gate
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.rules.scale_free import ScaleFreeForm
from pns_common.schemes import scale_free_scheme
from train.models.networks import INPUT_COUNT, BoundedNet, SymmetricNet, unit_correction
from train.models.recipe import Recipe, ToLimit, VertexRule
from train.models.tied import TiedNet
from train.refining import AnyScheme

# Usual sizes of features, by kind, on simplified meshes; others are about 1. Tied networks read
# features in these units, so that training sees all of them from the start.
FEATURE_SIZES: Mapping[str, float] = MappingProxyType(
    {
        "x": 0.1,
        "log": 0.7,
        "dihedral": 0.2,
        "m T": 0.1,
        "m B": 0.15,
        "umbrella": 0.08,
        "mean jump": 0.07,
        "bend": 0.13,
        "bend squared": 0.09,
        "umbrella height": 0.08,
        "umbrella length": 0.18,
        "neighbours' umbrella height": 0.07,
        "opening": 0.14,
        "neighbours' mean jump": 0.05,
    }
)

# The vertex network's draw is not the edge network's.
VERTEX_SEED = 1 << 20


def initial_network(recipe: Recipe) -> BoundedNet:
    """Return the untrained edge network of a recipe."""
    generator = torch.Generator().manual_seed(recipe.seed)
    if recipe.orientation != "symmetric":
        return BoundedNet(INPUT_COUNT[recipe.features], recipe.hidden, recipe.activation, generator)
    seen = FEATURE_SETS[recipe.features]
    return _keeping_symmetry(recipe, seen, recipe.hidden, generator)


def initial_vertex_network(recipe: Recipe) -> BoundedNet | None:
    """Return the untrained vertex network of a recipe; None where old vertices are Loop's."""
    if recipe.vertex is None:
        return None
    generator = torch.Generator().manual_seed(VERTEX_SEED + recipe.seed)
    seen = RING_FEATURE_SETS[recipe.vertex.features]
    return _keeping_symmetry(recipe, seen, recipe.vertex.hidden, generator)


def _keeping_symmetry(
    recipe: Recipe,
    seen: FeatureSet | RingFeatureSet,
    hidden: tuple[int, ...],
    generator: torch.Generator,
) -> BoundedNet:
    """Return a tied network for a scale-free rule, an averaged one for the paper's.

    Raises:
        ParameterError: a layer of a tied network is no whole number of copies of the group.
    """
    group = seen.symmetries
    if recipe.scale_free is None:
        return SymmetricNet(group, hidden, recipe.activation, generator)
    if any(width < 1 or width % len(group.order) for width in hidden):
        expected = f"multiples of {len(group.order)}, the symmetries of {seen.name}"
        raise ParameterError("hidden", hidden, expected=expected)
    sizes = np.array([FEATURE_SIZES.get(feature.kind, 1.0) for feature in seen.features])
    copies = tuple(width // len(group.order) for width in hidden)
    return TiedNet(group, copies, recipe.activation, generator, sizes)


def recipe_operator(recipe: Recipe, network: BoundedNet) -> EdgeOperator:
    """Return what a recipe makes of interior edges, with a network at budget 1."""
    return EdgeOperator(
        FEATURE_SETS[recipe.features],
        ORIENTATIONS[recipe.orientation],
        unit_correction(network),
        curvature_gate(recipe.gate_sharpness),
    )


def vertex_rule_operator(rule: VertexRule, network: BoundedNet) -> VertexOperator:
    """Return what a vertex rule makes of old vertices, likewise."""
    features = RING_FEATURE_SETS[rule.features]
    return VertexOperator(features, unit_correction(network), rule.gate_sharpness)


def recipe_scheme(
    recipe: Recipe, network: BoundedNet, vertex_network: BoundedNet | None
) -> AnyScheme:
    """Return the scheme that a scale-free recipe trains, differentiable in its networks' weights.

    s is that of training. Creases act in use alone.

    Raises:
        ParameterError: the recipe is not scale-free, or has no vertex rule.
    """
    form, rule, plan = recipe.scale_free, recipe.vertex, recipe.training
    if form is None or rule is None or not isinstance(plan, ToLimit) or vertex_network is None:
        raise ParameterError("recipe", recipe.name, expected="a scale-free one with a vertex rule")
    numbers = ScaleFreeForm(
        recipe.budget,
        plan.trained_strength,
        form.network_scale,
        form.fold_angle,
        learned_levels=1,
        boundary_strength=form.boundary_strength,
    )
    edges = recipe_operator(recipe, network)
    return scale_free_scheme(edges, vertex_rule_operator(rule, vertex_network), numbers)
