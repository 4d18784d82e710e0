"""The signed features with one group left out, or one added to the paper's: trainable as they are.

A feature set that is on no model card is trained and run through the same kernels; nothing of it is
registered.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.feature_set import FeatureSet
from pns_common.features.orientation import SYMMETRIC
from pns_common.formula.correction import curvature_gate
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.schemes import LearnedEdgeRule, Scheme, loop_vertex_rule
from train.data.batch import Batch
from train.fitting.one_step import refine_once
from train.fitting.trainer import OnStep, optimise, step_loss
from train.models.networks import BoundedNet, SymmetricNet, unit_correction
from train.models.recipe import Recipe
from train.models.torch_model import numpy_correction


@dataclass(frozen=True)
class Choice:
    """A feature set under trial, and what to call it."""

    title: str
    features: FeatureSet


def choices(whole: FeatureSet, base: FeatureSet) -> tuple[Choice, ...]:
    """List the whole set, it less each group beyond the base, the base, and base plus each."""
    groups = [group for group in whole.groups if group not in base.groups]
    less = [
        Choice(f"less {group.name}", _subset(whole, [g for g in whole.groups if g is not group]))
        for group in groups
    ]
    plus = [
        Choice(f"{base.name} and {group.name}", _subset(whole, [*base.groups, group]))
        for group in groups
    ]
    return (Choice(whole.name, whole), *less, Choice(base.name, base), *plus)


def fit_features(recipe: Recipe, features: FeatureSet, on_step: OnStep) -> BoundedNet:
    """Train a symmetric network over a feature set by the rest of a recipe."""

    def initial(recipe: Recipe) -> BoundedNet:
        generator = torch.Generator().manual_seed(recipe.seed)
        return SymmetricNet(features.symmetries, recipe.hidden, recipe.activation, generator)

    def loss(network: BoundedNet, batch: Batch) -> Float[Tensor, ""]:
        gate = curvature_gate(recipe.gate_sharpness)
        operator = EdgeOperator(features, SYMMETRIC, unit_correction(network), gate)
        step = refine_once(batch.points, batch.topology, operator, recipe.budget)
        return step_loss(recipe, batch, step)

    return optimise(recipe, loss, on_step, initial).network


def features_scheme(recipe: Recipe, features: FeatureSet, network: BoundedNet) -> Scheme:
    """Return the trained network as a scheme."""
    gate = curvature_gate(recipe.gate_sharpness)
    operator = EdgeOperator(features, SYMMETRIC, numpy_correction(network), gate)
    rule = LearnedEdgeRule(operator, recipe.budget)
    return Scheme(features.name, loop_vertex_rule, rule, budget=recipe.budget)


def named(table: Mapping[str, FeatureSet] = FEATURE_SETS) -> tuple[Choice, ...]:
    """Return the choices between the bundled sets."""
    return choices(table["signed-18"], table["paper-5"])


def _subset(whole: FeatureSet, blocks: list) -> FeatureSet:
    return FeatureSet(f"{whole.name} subset", tuple(blocks), whole.vertex_fields)
