"""Untrained networks of a recipe, and the paper's rule with one."""

import torch

from pns_common import ParameterError
from pns_common.model.features import FEATURE_SETS
from train.models.directed import DirectedNet
from train.models.networks import INPUT_COUNT, BoundedNet, SymmetricNet, unit_correction
from train.models.recipe import Recipe
from train.reference import EDGE_FEATURES, PaperRule


def initial_network(recipe: Recipe) -> BoundedNet:
    """Return the untrained network of a recipe of the paper's class."""
    generator = torch.Generator().manual_seed(recipe.seed)
    if recipe.orientation != "symmetric":
        return BoundedNet(INPUT_COUNT[recipe.features], recipe.hidden, recipe.activation, generator)
    group = FEATURE_SETS[recipe.features].symmetries
    return SymmetricNet(group, recipe.hidden, recipe.activation, generator)


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


def paper_rule(recipe: Recipe, network: BoundedNet) -> PaperRule:
    """Return the rule of a recipe of the paper's class, differentiable in weights and positions."""
    return PaperRule(
        unit_correction(network),
        recipe.budget,
        recipe.gate_sharpness,
        EDGE_FEATURES[recipe.features],
        first_face=recipe.orientation == "first-face",
    )
