"""Each part of the operator protects one promise: taken out, that is lost and no other."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pns_common import Mesh, loop, pns
from tests.support.meshes import bent, bumpy_sphere, grid, rotation
from train.experiments.harness.variants import (
    PNS,
    UNCONSTRAINED,
    VARIANTS,
    WITHOUT_GATE,
    fit_variant,
    variant_method,
    variant_recipe,
)
from train.fitting.trainer import fit
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.refining import refine

LOUD = 1e3
each_variant = pytest.mark.parametrize("variant", VARIANTS.values(), ids=lambda each: each.name)


def loud(variant):
    """A variant with weights so large that every bound is reached."""
    recipe = variant_recipe(paper(), variant)
    network = initial_network(recipe)
    with torch.no_grad():
        network.linear_layers[-1].weight.mul_(LOUD)
        network.linear_layers[-1].bias.mul_(LOUD)
    return variant_method(variant, network, recipe)


def departure(method, mesh):
    positions, expected = (refine(mesh, each, 1, 1.0).mesh.vertices for each in (method, loop()))
    return np.linalg.norm(positions - expected, axis=1).max()


@each_variant
def test_only_a_gate_reproduces_planes(variant):
    off = departure(loud(variant), Mesh(*grid(6)))
    assert (off < 1e-15) == (variant not in (WITHOUT_GATE, UNCONSTRAINED))


@each_variant
def test_only_a_bound_keeps_the_ratio_at_one(variant):
    ratio = refine(Mesh(*grid(6, bent)), loud(variant), 1, 1.0).ratio.max()
    assert (ratio <= 1 + 1e-12) == (variant in (PNS, WITHOUT_GATE))


@each_variant
def test_only_raw_coordinates_lose_rigid_motion(variant):
    vertices, faces = bumpy_sphere()
    turn = rotation(np.random.default_rng(1))
    here, there = (
        refine(Mesh(points, faces), loud(variant), 1, 1.0).mesh.vertices
        for points in (vertices, vertices @ turn.T)
    )
    assert (np.abs(there - here @ turn.T).max() < 1e-4) == (variant is not UNCONSTRAINED)


def test_the_full_variant_is_the_operator_and_trains_as_it():
    recipe, mesh = paper(), Mesh(*grid(6, bent))
    network = initial_network(recipe)
    ours = refine(mesh, variant_method(PNS, network, recipe), 2)
    theirs = refine(mesh, pns(recipe_model(recipe, network), recipe.budget), 2)
    np.testing.assert_allclose(ours.mesh.vertices, theirs.mesh.vertices, atol=1e-7)
    np.testing.assert_allclose(ours.ratio, theirs.ratio, atol=1e-6)
    recipe = replace(recipe, steps=3)
    losses = (fit_variant(PNS, recipe, _quiet).losses, fit(recipe, _quiet).losses)
    np.testing.assert_allclose(*losses, rtol=1e-6)


@each_variant
def test_every_variant_learns(variant):
    losses = fit_variant(
        variant, replace(variant_recipe(paper(), variant), steps=12), _quiet
    ).losses
    assert losses[-1] < losses[0]


def _quiet(done, loss):
    pass
