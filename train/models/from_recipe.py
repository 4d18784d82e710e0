"""Untrained networks of a recipe for edges and vertices, and their rules."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from pns_common import ParameterError, load_model
from pns_common.model.features import (
    FACE_FEATURE_SETS,
    FEATURE_SETS,
    RING_FEATURE_SETS,
    FeatureSet,
    Symmetries,
)
from train.models.directed import DirectedNet
from train.models.networks import (
    INPUT_COUNT,
    BoundedNet,
    Networks,
    SharpNet,
    SymmetricNet,
    unit_correction,
)
from train.models.recipe import Recipe, scale_free_parts
from train.models.tied import TiedNet
from train.reference import EDGE_FEATURES, GeneralRule, PaperRule

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
        "mean bend": 0.1,
        "middle of the bends": 0.1,
        "half the range of the bends": 0.1,
        "corners' umbrella height": 0.08,
        "half the range of these heights": 0.05,
    }
)

# Each network has a draw of its own.
VERTEX_SEED, SHARP_SEED, FACE_SEED = 1 << 20, 1 << 21, 1 << 22


def initial_network(recipe: Recipe) -> BoundedNet:
    """Return the untrained edge network of a recipe."""
    generator = torch.Generator().manual_seed(recipe.seed)
    if recipe.orientation != "symmetric":
        return BoundedNet(INPUT_COUNT[recipe.features], recipe.hidden, recipe.activation, generator)
    seen = FEATURE_SETS[recipe.features]
    return _keeping_symmetry(recipe, seen, seen.symmetries, recipe.hidden, generator)


def initial_directed(recipe: Recipe) -> DirectedNet:
    """Return the untrained network of directed edges of a recipe.

    Raises:
        ParameterError: it has none.
    """
    form = recipe.directed
    if form is None:
        raise ParameterError("recipe", recipe.name, expected="one of directed edges")
    generator = torch.Generator().manual_seed(recipe.seed)
    faces = form.base == "catmull-clark"
    return DirectedNet(generator, form.width, form.hidden, form.rounds, faces=faces)


def initial_vertex_network(recipe: Recipe) -> BoundedNet | None:
    """Return the untrained vertex network of a recipe; None where old vertices are Loop's."""
    if recipe.vertex is None:
        return None
    generator = torch.Generator().manual_seed(VERTEX_SEED + recipe.seed)
    seen = RING_FEATURE_SETS[recipe.vertex.features]
    return _keeping_symmetry(recipe, seen, seen.symmetries, recipe.vertex.hidden, generator)


# The default has another network since: the sharpness that recipes name stands in its companion.
KEPT_IN = {"general": "general-quad"}


def initial_sharpness_network(recipe: Recipe) -> SharpNet | None:
    """Return the untrained sharpness network of a recipe, or another model's; None without one."""
    seen = recipe.sharpness
    if seen is None:
        return None
    generator = torch.Generator().manual_seed(SHARP_SEED + recipe.seed)
    made = SharpNet(INPUT_COUNT[seen.features], seen.hidden, recipe.activation, generator)
    return made if seen.of_model is None else taken_over(made, seen.of_model)


def taken_over(network: SharpNet, model: str) -> SharpNet:
    """Return a sharpness network with the weights of a bundled model's, which stay as they are."""
    graph = onnx.load_from_string(load_model(KEPT_IN.get(model, model)).data).graph
    arrays = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    for number, layer in enumerate(network.linear_layers):
        layer.weight.data.copy_(torch.from_numpy(arrays[f"sharpness_weight_{number}"].copy()))
        layer.bias.data.copy_(torch.from_numpy(arrays[f"sharpness_bias_{number}"].copy()))
    return network.requires_grad_(False)


def initial_face_network(recipe: Recipe) -> BoundedNet | None:
    """Return the untrained face network of a recipe; None where its scheme has none."""
    if recipe.face is None:
        return None
    generator = torch.Generator().manual_seed(FACE_SEED + recipe.seed)
    seen = FACE_FEATURE_SETS[recipe.face.features]
    # It answers along the normal alone.
    along = replace(seen.symmetries, local=seen.symmetries.local[:, :1])
    return _keeping_symmetry(recipe, seen, along, recipe.face.hidden, generator)


def initial_networks(recipe: Recipe) -> Networks:
    """Return the untrained networks of a scale-free recipe.

    Raises:
        ParameterError: it has no vertex rule, or no sharpness network.
    """
    vertex, sharp = initial_vertex_network(recipe), initial_sharpness_network(recipe)
    if vertex is None or sharp is None:
        raise ParameterError("recipe", recipe.name, expected="three networks")
    return Networks(initial_network(recipe), vertex, sharp, initial_face_network(recipe))


def _keeping_symmetry(
    recipe: Recipe,
    seen: FeatureSet,
    group: Symmetries,
    hidden: tuple[int, ...],
    generator: torch.Generator,
) -> BoundedNet:
    """Return a tied network for a scale-free rule, an averaged one for the paper's.

    Raises:
        ParameterError: a layer of a tied network is no whole number of copies of the group.
    """
    if recipe.scale_free is None:
        return SymmetricNet(group, hidden, recipe.activation, generator)
    if any(width < 1 or width % len(group.order) for width in hidden):
        expected = f"multiples of {len(group.order)}, the symmetries of {seen.name}"
        raise ParameterError("hidden", hidden, expected=expected)
    sizes = np.array([FEATURE_SIZES.get(feature.kind, 1.0) for feature in seen.features])
    copies = tuple(width // len(group.order) for width in hidden)
    return TiedNet(group, copies, recipe.activation, generator, sizes)


def paper_rule(recipe: Recipe, network: BoundedNet) -> PaperRule:
    """Return the rule of a recipe of the paper's class, differentiable in weights and positions."""
    return PaperRule(
        unit_correction(network),
        recipe.budget,
        recipe.gate_sharpness,
        EDGE_FEATURES[recipe.features],
        first_face=recipe.orientation == "first-face",
    )


def general_rule(recipe: Recipe, network: BoundedNet, vertex_network: BoundedNet) -> GeneralRule:
    """Return the rule of a scale-free recipe as it is trained, differentiable likewise.

    Raises:
        ParameterError: the recipe is not scale-free, or has no vertex rule.
    """
    form, vertex_rule = scale_free_parts(recipe)
    return GeneralRule(
        unit_correction(network),
        unit_correction(vertex_network),
        recipe.budget,
        recipe.gate_sharpness,
        vertex_rule.gate_sharpness,
        form.prior_strength,
        form.boundary_strength,
        form.network_scale,
        form.fold_angle,
        EDGE_FEATURES[recipe.features],
    )
