"""What a model card says of a model's results, by names under which they can be measured again."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from pns_common.schemes import Scheme, loop
from train.datasets import ridge_held_out, saddle_held_out, sphere_ridge_held_out
from train.evaluation import compare_with_loop
from train.metrics import Improvement, improvement
from train.recipes import Recipe
from train.whole_surface import whole_surface

LEVELS = 4


def after_four_levels(scheme: Scheme) -> dict[str, Improvement]:
    """Compare with Loop on the held-out ridges: all vertices, all faces, the largest jump."""
    held_out = ridge_held_out()
    found, reference = (whole_surface(one, held_out, LEVELS) for one in (scheme, loop()))
    shown = ("distance", "normal", "jump")
    return {name: improvement(getattr(reference, name), getattr(found, name)) for name in shown}


def _without_near(found: Mapping[str, Improvement]) -> dict[str, Improvement]:
    """Leave out what is measured near the ridge, where nothing is near it."""
    return {name: row for name, row in found.items() if not math.isnan(row.percent)}


MEASURES: Mapping[str, Callable[[Scheme], Mapping[str, Improvement]]] = MappingProxyType(
    {
        "ridge-held-out": lambda scheme: compare_with_loop(scheme, ridge_held_out()),
        "ridge-held-out after 4 levels": after_four_levels,
        "saddle-held-out": lambda scheme: compare_with_loop(scheme, saddle_held_out()),
        "sphere-ridge-held-out": lambda scheme: _without_near(
            compare_with_loop(scheme, sphere_ridge_held_out())
        ),
    }
)
"""One step by the published metrics where nothing else is said."""

ONE_STEP = ("ridge-held-out",)
"""All that there is to say of a model that was trained on ridges for one step."""


def card_metrics(recipe: Recipe, scheme: Scheme) -> dict[str, Mapping[str, Improvement]]:
    """Measure a trained scheme for its card."""
    names = ONE_STEP if recipe.stream is None else tuple(MEASURES)
    return {name: MEASURES[name](scheme) for name in names}
