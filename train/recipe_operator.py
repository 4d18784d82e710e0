"""What a recipe makes of edges and vertices: its untrained networks, and their rules."""

from collections.abc import Sequence

import torch

from pns_common.correction import curvature_gate
from pns_common.edge_operator import EdgeOperator
from pns_common.features import FEATURE_SETS
from pns_common.orientation import ORIENTATIONS
from pns_common.ring_features import RING_FEATURE_SETS
from pns_common.symmetry import Feature
from pns_common.vertex_operator import VertexOperator
from train.networks import INPUT_COUNT, BoundedNet, Hush, SymmetricNet, unit_correction
from train.recipes import Recipe, VertexRule

UMBRELLA_HEIGHTS = ("umbrella", "umbrella height", "neighbours' umbrella height")
"""Kinds of features, of edges and of rings."""

# The vertex network's draw is not the edge network's.
VERTEX_SEED = 1 << 20


def initial_network(recipe: Recipe) -> BoundedNet:
    """Return the untrained edge network of a recipe."""
    generator = torch.Generator().manual_seed(recipe.seed)
    if recipe.orientation == "symmetric":
        seen = FEATURE_SETS[recipe.features]
        hush = umbrella_hush(seen.features, recipe.hush)
        return SymmetricNet(seen.symmetries, recipe.hidden, recipe.activation, generator, hush)
    if recipe.hush is not None and recipe.vertex is None:
        raise ParameterError("hush", recipe.hush, expected="the orientation symmetric")
    return BoundedNet(INPUT_COUNT[recipe.features], recipe.hidden, recipe.activation, generator)


def initial_vertex_network(recipe: Recipe) -> BoundedNet | None:
    """Return the untrained vertex network of a recipe; None where old vertices are Loop's."""
    if recipe.vertex is None:
        return None
    generator = torch.Generator().manual_seed(VERTEX_SEED + recipe.seed)
    seen = RING_FEATURE_SETS[recipe.vertex.features]
    hush = umbrella_hush(seen.features, recipe.hush)
    return SymmetricNet(seen.symmetries, recipe.vertex.hidden, recipe.activation, generator, hush)


def umbrella_hush(features: Sequence[Feature], width: float | None) -> Hush | None:
    """Return the hush over all umbrella heights among some features; None without a width.

    Raises:
        ParameterError: there is no umbrella height among them: the network would always be silent.
    """
    if width is None:
        return None
    columns = tuple(k for k, one in enumerate(features) if one.kind in UMBRELLA_HEIGHTS)
    if not columns:
        raise ParameterError("hush", width, expected="features with umbrella heights")
    return Hush(columns, width)


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
