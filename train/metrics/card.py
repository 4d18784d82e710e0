"""Held-out evaluation against Loop, and the named measures of a model card."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from pns_common import Scheme, loop
from train.connectivity import connect
from train.data.datasets import (
    Dataset,
    Instance,
    ridge_held_out,
    saddle_held_out,
    sphere_ridge_held_out,
)
from train.metrics.one_step import METRICS, Errors, Improvement, improvement, one_step_errors
from train.metrics.whole_surface import whole_surface
from train.models.recipe import OneStep, Recipe
from train.refining import AnyScheme, Method, Smooth, refine

LEVELS = 4


def after_four_levels(scheme: AnyScheme, held_out: Dataset) -> dict[str, Improvement]:
    """Compare with Loop on a data set: all vertices, all faces, the largest jump."""
    ours, reference = (whole_surface(rule, held_out, LEVELS) for rule in (scheme, loop()))
    shown = ("distance", "normal", "jump")
    return {name: improvement(getattr(reference, name), getattr(ours, name)) for name in shown}


def _without_near(improvements: Mapping[str, Improvement]) -> dict[str, Improvement]:
    """Leave out what is measured near the ridge, where nothing is near it."""
    return {name: row for name, row in improvements.items() if not math.isnan(row.percent)}


# One step by the published metrics where nothing else is said.
MEASURES: Mapping[str, Callable[[AnyScheme], Mapping[str, Improvement]]] = MappingProxyType(
    {
        "ridge-held-out": lambda scheme: compare_with_loop(scheme, ridge_held_out()),
        "ridge-held-out after 4 levels": lambda scheme: after_four_levels(scheme, ridge_held_out()),
        "saddle-held-out after 4 levels": lambda scheme: after_four_levels(
            scheme, saddle_held_out()
        ),
        "sphere-ridge-held-out after 4 levels": lambda scheme: after_four_levels(
            scheme, sphere_ridge_held_out()
        ),
        "saddle-held-out": lambda scheme: compare_with_loop(scheme, saddle_held_out()),
        "sphere-ridge-held-out": lambda scheme: _without_near(
            compare_with_loop(scheme, sphere_ridge_held_out())
        ),
    }
)

# All that there is to say of a model that was trained on ridges for one step.
ONE_STEP = ("ridge-held-out",)

# What there is to say of one that aims at the limit: where it is after one step says nothing.
TO_LIMIT = tuple(name for name in MEASURES if name.endswith("levels"))


def card_metrics(recipe: Recipe, scheme: AnyScheme) -> dict[str, Mapping[str, Improvement]]:
    """Measure a trained scheme for its card; nothing over Catmull–Clark: all sets are triangles."""
    if recipe.directed is not None and recipe.directed.base != "loop":
        return {}
    names = ONE_STEP if isinstance(recipe.training, OneStep) else TO_LIMIT
    return {name: MEASURES[name](scheme) for name in names}


# For each metric its value on every instance of a data set.
ErrorTable = Mapping[str, Float[np.ndarray, " N"]]


# A scheme for each instance: for what may look at the surface, as the envelope's limit does.
SchemeOf = Callable[[Instance], AnyScheme]


def one_step_table(scheme: AnyScheme | SchemeOf, dataset: Dataset) -> ErrorTable:
    """Refine every instance by one step in the paper's units and measure it."""
    choose = (lambda _: scheme) if isinstance(scheme, Scheme | Method | Smooth) else scheme
    rows = [_instance_errors(choose(instance), instance) for instance in dataset.instances]
    return {metric: np.array([getattr(row, metric) for row in rows]) for metric in METRICS}


def compare_with_loop(scheme: AnyScheme | SchemeOf, dataset: Dataset) -> dict[str, Improvement]:
    """Return the paired improvement of a scheme over Loop for each metric."""
    reference, method = one_step_table(loop(), dataset), one_step_table(scheme, dataset)
    return {metric: improvement(reference[metric], method[metric]) for metric in METRICS}


def _instance_errors(scheme: AnyScheme, instance: Instance) -> Errors:
    mesh = instance.mesh
    refined = refine(mesh, scheme, levels=1, reference_length=1.0).mesh
    level = connect(mesh.faces, len(mesh.vertices))
    inserted = refined.vertices[level.vertex_count + level.interior.numpy()]
    return one_step_errors(instance.surface, mesh.vertices, level, inserted)
