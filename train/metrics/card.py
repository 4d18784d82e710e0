"""Held-out evaluation against Loop, and the named measures of a model card."""

from collections.abc import Callable, Mapping

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
from train.refining import refine

LEVELS = 4


def after_four_levels(scheme: Scheme, held_out: Dataset) -> dict[str, Improvement]:
    """Compare with Loop on a data set: all vertices, all faces, the largest jump."""
    ours, reference = (whole_surface(rule, held_out, LEVELS) for rule in (scheme, loop()))
    shown = ("distance", "normal", "jump")
    return {name: improvement(getattr(reference, name), getattr(ours, name)) for name in shown}


MEASURES: Mapping[str, Callable[[Scheme], Mapping[str, Improvement]]] = {
    "ridge-held-out": lambda scheme: compare_with_loop(scheme, ridge_held_out()),
    "ridge-held-out after 4 levels": lambda scheme: after_four_levels(scheme, ridge_held_out()),
    "saddle-held-out after 4 levels": lambda scheme: after_four_levels(scheme, saddle_held_out()),
    "sphere-ridge-held-out after 4 levels": lambda scheme: after_four_levels(
        scheme, sphere_ridge_held_out()
    ),
}
# Of a model of edge vertices, and of one that aims at the limit: where that is after one step says
# nothing.
ONE_STEP, *TO_LIMIT = MEASURES


def card_metrics(recipe: Recipe, scheme: Scheme) -> dict[str, Mapping[str, Improvement]]:
    """Measure a trained scheme for its card; nothing over Catmull–Clark: all sets are triangles."""
    if recipe.directed is not None and recipe.directed.base != "loop":
        return {}
    names = [ONE_STEP] if isinstance(recipe.training, OneStep) else TO_LIMIT
    return {name: MEASURES[name](scheme) for name in names}


# For each metric its value on every instance of a data set.
ErrorTable = Mapping[str, Float[np.ndarray, " N"]]


# A scheme for each instance: for what may look at the surface, as the envelope's limit does.
SchemeOf = Callable[[Instance], Scheme]


def one_step_table(scheme: Scheme | SchemeOf, dataset: Dataset) -> ErrorTable:
    """Refine every instance by one step in the paper's units and measure it."""
    choose = (lambda _: scheme) if isinstance(scheme, Scheme) else scheme
    rows = [_instance_errors(choose(instance), instance) for instance in dataset.instances]
    return {metric: np.array([getattr(row, metric) for row in rows]) for metric in METRICS}


def compare_with_loop(scheme: Scheme | SchemeOf, dataset: Dataset) -> dict[str, Improvement]:
    """Return the paired improvement of a scheme over Loop for each metric."""
    reference, method = one_step_table(loop(), dataset), one_step_table(scheme, dataset)
    return {metric: improvement(reference[metric], method[metric]) for metric in METRICS}


def _instance_errors(scheme: Scheme, instance: Instance) -> Errors:
    mesh = instance.mesh
    refined = refine(mesh, scheme, levels=1, reference_length=1.0).mesh
    level = connect(mesh.faces, len(mesh.vertices))
    inserted = refined.vertices[level.vertex_count + level.interior.numpy()]
    return one_step_errors(instance.surface, mesh.vertices, level, inserted)
