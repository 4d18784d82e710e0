"""Recipes of single experiments: the default one with one thing changed."""

from dataclasses import replace

import msgspec

from train.models.recipe import Recipe, one_step
from train.models.recipes import paper


def paper_with_budget(budget: float) -> Recipe:
    """Return the default recipe with another C; at its own C it is the default one itself."""
    recipe = paper()
    if budget == recipe.budget:
        return recipe
    return replace(recipe, name=f"ridge-C{budget:g}", budget=budget)


def larger() -> Recipe:
    """Return a network of three times the parameters, trained for twice the steps."""
    recipe = paper()
    return replace(recipe, name="capacity", hidden=(64, 64), steps=2 * recipe.steps)


def saddle() -> Recipe:
    """Return the default recipe on saddles."""
    base = paper()
    plan = msgspec.structs.replace(one_step(base), dataset="saddle-training", batch_size=12)
    return replace(base, name="saddle", training=plan)
