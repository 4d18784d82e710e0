"""The eight methods of the paper's comparison, trained or fitted, by the names of the style."""

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import msgspec

from pns_common import Mesh, Refinement, Scheme, loop
from train.baselines.butterfly import modified_butterfly
from train.baselines.edge_rules import curvature_adaptive, fit_scalar, normal_displacement
from train.baselines.pn_triangles import pn_triangles
from train.baselines.quadric import quadric_fit
from train.data.datasets import Dataset, Instance, ridge_held_out
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.variants import UNCONSTRAINED, variant_recipe, variant_scheme
from train.experiments.paper.paper_values import PAPER_INSTANCE
from train.models.recipe import Recipe, one_step
from train.models.recipes import paper
from train.refining import refine
from train.surfaces.implicit import Ridge

# Reference length of all experiments: the paper's C is absolute.
PAPER_UNITS = 1.0


def eight_methods(laboratory: Laboratory) -> dict[str, Scheme]:
    """Return Loop, five hand-made methods, PNS and the unconstrained network."""
    recipe = paper()
    training_set = laboratory.dataset(one_step(recipe).dataset)
    return {
        "loop": loop(),
        "butterfly": modified_butterfly(),
        "pn-triangles": pn_triangles(),
        "quadric": quadric_fit(),
        "normal-displacement": normal_displacement(fit_scalar(training_set)),
        "curvature-adaptive": curvature_adaptive(recipe.gate_sharpness),
        "pns": laboratory.scheme(recipe),
        "unconstrained": unconstrained_scheme(laboratory),
    }


def learned_methods(laboratory: Laboratory) -> dict[str, Scheme]:
    """Return Loop and the two learned methods, which the paper's figures set side by side."""
    return {
        "loop": loop(),
        "pns": laboratory.scheme(paper()),
        "unconstrained": unconstrained_scheme(laboratory),
    }


def unconstrained_scheme(laboratory: Laboratory) -> Scheme:
    """Return the unconstrained network, trained on the same ridges; ratios are against PNS's C h².

    It is a control that shows what the envelope is for, and no method to use.
    """
    recipe = variant_recipe(paper(), UNCONSTRAINED)
    return variant_scheme(UNCONSTRAINED, laboratory.network(recipe, UNCONSTRAINED), recipe)


def hard_instance() -> Instance:
    """Return the held-out ridge that the paper's figures and its repeated table show."""
    amplitude, sharpness = PAPER_INSTANCE["amplitude"], PAPER_INSTANCE["sharpness"]

    def difference(instance: Instance) -> float:
        ridge = ridge_of(instance)
        return abs(ridge.amplitude - amplitude) + abs(ridge.sharpness - sharpness)

    return min(ridge_held_out().instances, key=difference)


def ridge_of(instance: Instance) -> Ridge:
    """Return the surface of an instance from a data set of ridges."""
    return cast(Ridge, instance.surface)


def largest_ratio(scheme: Scheme, dataset: Dataset) -> float:
    """Return the largest proximity ratio of one step, over all instances."""
    return max(
        float(refine(instance.mesh, scheme, 1, reference_length=PAPER_UNITS).ratio.max())
        for instance in dataset.instances
    )


def level_by_level(mesh: Mesh, scheme: Scheme, levels: int) -> Iterator[Refinement]:
    """Yield the refinement after each level; every step keeps the paper's units."""
    for _ in range(levels):
        refinement = refine(mesh, scheme, levels=1, reference_length=PAPER_UNITS)
        mesh = refinement.mesh
        yield refinement


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
