"""Networks: bounded for any weights, tied or averaged over the symmetries of what they read."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns
from pns_common.model.features import DIRECTED_28
from tests.support.control_points import refine
from tests.support.directed import random_network
from tests.support.meshes import bumpy_sphere, manifolds
from tests.support.renumbering import MIRROR, mirrored, renumbered, turned_over
from train.certificates.equivariance import well_conditioned
from train.models.directed import MIRRORED
from train.models.from_recipe import initial_network
from train.models.networks import ACTIVATIONS, BoundedNet
from train.models.recipes import paper
from train.models.torch_model import recipe_model


def network(seed=0, hidden=(8, 8), activation="gelu"):
    return BoundedNet(5, hidden, activation, torch.Generator().manual_seed(seed))


@given(
    seed=st.integers(0, 2**31),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    budget=st.floats(1e-6, 1e6),
    activation=st.sampled_from(sorted(ACTIVATIONS)),
)
def test_output_stays_in_the_ball_for_any_weights(seed, scale, budget, activation):
    net = network(seed, activation=activation).double()
    features = torch.from_numpy(np.random.default_rng(seed).normal(size=(64, 5)) * 10)
    with torch.no_grad():
        for layer in net.linear_layers:
            layer.weight *= scale
        lengths = torch.linalg.vector_norm(net(features, budget), dim=-1)
    assert (lengths <= budget * (1 + 1e-12)).all()


EXACT = 1e-12
SIGNED = ["signed-18"]


def model(features="paper-5", orientation="symmetric", seed=0):
    """A double precision model with loud random weights."""
    recipe = replace(paper(seed), features=features, orientation=orientation)
    network = initial_network(recipe).double()
    with torch.no_grad():
        for layer in network.linear_layers:
            layer.weight *= 3
    return recipe_model(recipe, network)


def apart(mesh, twin, subject, expected=lambda positions: positions):
    """Return how far the twin's refined vertices are from their places, where well defined."""
    positions = refine(twin.mesh, pns(subject), 1, 1.0).mesh.vertices[twin.place]
    wanted = expected(refine(mesh, pns(subject), 1, 1.0).mesh.vertices)
    kept = np.ones(len(positions), dtype=bool)
    kept[len(mesh.vertices) :] = well_conditioned(mesh)
    return np.linalg.norm(positions - wanted, axis=1)[kept].max(initial=0)


def reflected(positions):
    return positions * MIRROR


feature_sets = pytest.mark.parametrize("features", ["paper-5", "signed-18"])


@feature_sets
@given(mesh=manifolds(), seed=st.integers(0, 2**31))
def test_numbering_mirrors_and_turning_over_change_nothing_on_any_manifold(features, mesh, seed):
    subject = model(features)
    assert apart(mesh, renumbered(mesh, seed), subject) < EXACT
    assert apart(mesh, mirrored(mesh), subject, reflected) < EXACT
    if features in SIGNED:
        assert apart(mesh, turned_over(mesh), subject) < EXACT


def test_the_papers_orientation_promises_none_of_this():
    mesh, subject = Mesh(*bumpy_sphere()), model(orientation="first-face")
    assert apart(mesh, renumbered(mesh, 0), subject) > 1e-4
    assert apart(mesh, mirrored(mesh), subject, reflected) > 1e-4


def test_the_mirror_exchanges_the_states_of_directed_edges_for_any_weights():
    """Features of the mirrored edge have the other half of each state; answers change signs."""
    group, network = DIRECTED_28.symmetries, random_network(3, 1.0, faces=True)
    rows = torch.from_numpy(np.random.default_rng(0).standard_normal((50, 28)))
    mirrored = rows[:, group.order[1]] * torch.from_numpy(group.signs[1])
    state, twin = network.encoder(rows), network.encoder(mirrored)
    half = state.shape[1] // 2
    torch.testing.assert_close(twin, state.roll(half, 1), rtol=0, atol=1e-12)
    signs = torch.tensor((*MIRRORED, 1.0), dtype=torch.float64)
    answers = network.heads(state)
    torch.testing.assert_close(network.heads(twin), answers * signs, rtol=0, atol=1e-12)
    assert answers.abs().max() > 0.1
