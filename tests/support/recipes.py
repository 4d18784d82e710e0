"""Recipes cut down to a few steps, and one with a vertex rule in the paper's envelope."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from train.models.recipe import Recipe, ToLimit, VertexRule
from train.models.recipes import signed


def tiny(recipe: Recipe, steps: int = 4) -> Recipe:
    """The recipe with so many steps; what trains to the limit takes one small batch."""
    if not isinstance(recipe.training, ToLimit):
        return replace(recipe, steps=steps)
    plan = msgspec.structs.replace(recipe.training, faces=100, pool=1)
    return replace(recipe, steps=2, training=plan)


def both_rules(seed: int = 0) -> Recipe:
    """The paper's envelope with symmetric networks for edges and old vertices (format 2)."""
    rule = VertexRule("ring-10", hidden=(24, 24), gate_sharpness=1e3)
    return replace(
        signed(seed), name="both", hidden=(24, 24), budget=0.8, gate_sharpness=1e5, vertex=rule
    )
