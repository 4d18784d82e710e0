"""Each part of the operator protects one promise: taken out, that is lost and no other."""

from dataclasses import replace

import numpy as np

from pns_common import Mesh, pns
from tests.support.meshes import bent, grid
from train.experiments.harness.variants import (
    PNS,
    fit_variant,
    variant_scheme,
)
from train.fitting.trainer import fit
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.refining import refine


def test_the_full_variant_is_the_operator_and_trains_as_it():
    recipe, mesh = paper(), Mesh(*grid(6, bent))
    network = initial_network(recipe)
    ours = refine(mesh, variant_scheme(PNS, network, recipe), 2)
    theirs = refine(mesh, pns(recipe_model(recipe, network), recipe.budget), 2)
    np.testing.assert_allclose(ours.mesh.vertices, theirs.mesh.vertices, atol=1e-7)
    np.testing.assert_allclose(ours.ratio, theirs.ratio, atol=1e-6)
    recipe = replace(recipe, steps=3)
    losses = (fit_variant(PNS, recipe, _quiet).losses, fit(recipe, _quiet).losses)
    np.testing.assert_allclose(*losses, rtol=1e-6)


def _quiet(done, loss):
    pass
