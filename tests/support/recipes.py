"""Recipes cut down to a few steps."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from train.models.recipe import Recipe, ToLimit


def tiny(recipe: Recipe, steps: int = 4) -> Recipe:
    """The recipe with so many steps; what trains to the limit takes one small batch."""
    if not isinstance(recipe.training, ToLimit):
        return replace(recipe, steps=steps)
    plan = msgspec.structs.replace(recipe.training, faces=100, pool=1)
    return replace(recipe, steps=2, training=plan)
