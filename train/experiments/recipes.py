"""Recipes of single experiments: the default one with one thing changed."""

from dataclasses import replace

from train.recipes import Recipe, ridge


def ridge_with_budget(budget: float) -> Recipe:
    """Return the default recipe with another C; at its own C it is the default one itself."""
    recipe = ridge()
    if budget == recipe.budget:
        return recipe
    return replace(recipe, name=f"ridge-C{budget:g}", budget=budget)


def larger() -> Recipe:
    """Return a network of three times the parameters, trained for twice the steps."""
    recipe = ridge()
    return replace(recipe, name="capacity", hidden=(64, 64), steps=2 * recipe.steps)


def saddle() -> Recipe:
    """Return the default recipe on saddles."""
    return replace(ridge(), name="saddle", dataset="saddle-training", batch_size=12)
