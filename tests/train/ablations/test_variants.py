"""Each variant loses the property that its missing part protects, and keeps the others."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from pns_common import Mesh, loop, refine
from pns_common.schemes import pns
from tests.support.meshes import bent, bumpy_sphere, grid, rotation, soups
from train.ablations.variants import (
    PNS,
    UNCONSTRAINED,
    VARIANTS,
    WITHOUT_BOUND,
    WITHOUT_GATE,
    WITHOUT_SQUARE,
    fit_variant,
    variant_recipe,
    variant_scheme,
)
from train.fitting.trainer import fit
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model

LOUD = 20.0


def loud_scheme(variant):
    """A variant with weights so large that every bound is reached."""
    recipe = variant_recipe(paper(), variant)
    network = initial_network(recipe)
    with torch.no_grad():
        network.linear_layers[-1].weight.mul_(LOUD)
        network.linear_layers[-1].bias.mul_(LOUD)
    return variant_scheme(variant, network, recipe)


def departure(scheme, mesh):
    positions = refine(mesh, scheme, 1, reference_length=1.0).mesh.vertices
    expected = refine(mesh, loop(), 1, reference_length=1.0).mesh.vertices
    return np.linalg.norm(positions - expected, axis=1).max()


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=lambda variant: variant.name)
def test_only_a_gate_reproduces_planes(variant):
    vertices, faces = grid(6)
    keeps = variant not in (WITHOUT_GATE, UNCONSTRAINED)
    assert (departure(loud_scheme(variant), Mesh(vertices, faces)) == 0) == keeps


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=lambda variant: variant.name)
def test_only_a_bound_keeps_the_ratio_at_one(variant):
    mesh = Mesh(*grid(6, bent))
    ratio = refine(mesh, loud_scheme(variant), 1, reference_length=1.0).ratio.max()
    assert (ratio <= 1 + 1e-12) == (variant in (PNS, WITHOUT_GATE))


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=lambda variant: variant.name)
def test_only_raw_coordinates_lose_rigid_motion(variant):
    vertices, faces = bumpy_sphere()
    turn = rotation(np.random.default_rng(1))
    scheme = loud_scheme(variant)
    here = refine(Mesh(vertices, faces), scheme, 1, reference_length=1.0).mesh.vertices
    there = refine(Mesh(vertices @ turn.T, faces), scheme, 1, reference_length=1.0).mesh.vertices
    assert (np.abs(there - here @ turn.T).max() < 1e-4) == (variant is not UNCONSTRAINED)


@pytest.mark.parametrize(
    ("variant", "power"), [(PNS, 2), (WITHOUT_GATE, 2), (WITHOUT_BOUND, 2), (WITHOUT_SQUARE, 1)]
)
def test_the_power_of_h_is_seen_in_the_scale(variant, power):
    """Features are free of scale: a mesh of half the size moves by half, to the power of h."""
    vertices, faces = grid(6, bent)
    scheme = loud_scheme(variant)
    large = departure(scheme, Mesh(vertices, faces))
    small = departure(scheme, Mesh(vertices / 2, faces))
    assert large / small == pytest.approx(2**power, rel=1e-5)


def test_the_full_variant_is_the_operator():
    recipe, mesh = paper(), Mesh(*grid(6, bent))
    network = initial_network(recipe)
    ours = refine(mesh, variant_scheme(PNS, network, recipe), levels=2)
    theirs = refine(mesh, pns(recipe_model(recipe, network), recipe.budget), levels=2)
    np.testing.assert_allclose(ours.mesh.vertices, theirs.mesh.vertices, atol=1e-7)
    np.testing.assert_allclose(ours.ratio, theirs.ratio, atol=1e-6)


def test_training_the_full_variant_is_training_the_operator():
    recipe = replace(paper(), steps=3)
    ours = fit_variant(PNS, recipe, lambda *_: None)
    theirs = fit(recipe, lambda *_: None)
    assert ours.losses == theirs.losses
    for own, twin in zip(ours.network.parameters(), theirs.network.parameters(), strict=True):
        assert own.equal(twin)


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=lambda variant: variant.name)
def test_every_variant_learns(variant):
    recipe = replace(variant_recipe(paper(), variant), steps=12)
    losses = fit_variant(variant, recipe, lambda *_: None).losses
    assert losses[-1] < losses[0]


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=lambda variant: variant.name)
@settings(max_examples=10)
@given(mesh=soups())
def test_every_variant_refines_any_mesh_over_and_over(variant, mesh):
    recipe = variant_recipe(paper(), variant)
    scheme = variant_scheme(variant, initial_network(recipe), recipe)
    assert np.isfinite(refine(mesh, scheme, levels=2, threads=1).mesh.vertices).all()


def test_a_mesh_without_size_is_left_to_loop():
    point = Mesh(np.ones((4, 3)), np.array([[0, 1, 2], [2, 1, 3]]))
    positions = refine(point, loud_scheme(UNCONSTRAINED), 1).mesh.vertices
    np.testing.assert_array_equal(positions, 1)
