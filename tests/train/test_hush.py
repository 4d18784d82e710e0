"""The hush: silent where every umbrella height vanishes, whatever the weights."""

import copy

import numpy as np
import pytest
import torch

from export.onnx_graph import model_bytes
from pns_common import Mesh, loop, pns, refine
from pns_common.features import FEATURE_SETS
from pns_common.onnx_model import model_from_bytes
from pns_common.ring_features import RING_FEATURE_SETS
from train.grid import grid_faces, jittered_grid
from train.recipe_operator import initial_network, initial_vertex_network
from train.recipes import full
from train.torch_model import recipe_model

RECIPE = full(2)


def loud_networks():
    both = initial_network(RECIPE), initial_vertex_network(RECIPE)
    for network in both:
        with torch.no_grad():
            for weight in network.parameters():
                weight *= 3
    return both


def saddle_mesh(amplitude):
    """A harmonic height on the regular grid: every umbrella is 0 but at the border."""
    plane = jittered_grid(0, jitter=0.0).double().numpy()
    height = amplitude * (plane[:, 0] ** 2 - plane[:, 1] ** 2)
    return Mesh(np.concatenate([plane, height[:, None]], axis=1), grid_faces())


def bowl_mesh(amplitude):
    mesh = saddle_mesh(0.0)
    points = mesh.vertices.copy()
    points[:, 2] = amplitude * (points[:, 0] ** 2 + points[:, 1] ** 2)
    return Mesh(points, mesh.faces)


def departure(mesh):
    scheme = pns(recipe_model(RECIPE, *loud_networks()))
    found, base = (refine(mesh, one, 1, 1.0).mesh.vertices for one in (scheme, loop()))
    return np.abs(found - base).max()


def test_it_is_silent_on_a_gentle_saddle_and_not_on_a_bowl():
    assert departure(saddle_mesh(0.2)) < 2e-4
    assert departure(bowl_mesh(0.2)) > 2e-3


@pytest.mark.parametrize("which", [0, 1])
def test_the_hush_keeps_the_symmetry_and_the_bound(which):
    network = loud_networks()[which].double()
    sets = FEATURE_SETS[RECIPE.features], RING_FEATURE_SETS[RECIPE.vertex.features]
    group = sets[which].symmetries
    rows = torch.from_numpy(np.random.default_rng(0).uniform(-0.3, 0.3, (50, sets[which].count)))
    plain = network(rows, 0.7).detach()
    assert float(torch.linalg.vector_norm(plain, dim=1).max()) <= 0.7 + 1e-12
    for order, signs, local in zip(group.order, group.signs, group.local, strict=True):
        image = network(rows[:, order] * torch.from_numpy(signs), 0.7).detach()
        np.testing.assert_allclose(image, plain * torch.from_numpy(local), atol=1e-12)


def test_the_model_file_is_silent_too():
    network, vertex_network = loud_networks()
    card = recipe_model(RECIPE, network, vertex_network).card
    file = model_from_bytes(model_bytes(network, card, vertex_network), "hushed")
    rng = np.random.default_rng(0)
    for answer, own in ((file, network), (file.vertex_correction, vertex_network)):
        rows = rng.uniform(-0.5, 0.5, (64, own.linear_layers[0].in_features)).astype(np.float32)
        rows[:32, list(own.hush.columns)] = 0
        found = answer(rows, 1.0)
        assert (found[:32] == 0).all()
        assert np.abs(found[32:]).max() > 0.05
        with torch.no_grad():
            exact = copy.deepcopy(own).double()(torch.from_numpy(rows).double(), 1.0).numpy()
        np.testing.assert_allclose(found, exact, atol=1e-6)
