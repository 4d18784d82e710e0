"""Networks: bounded for any weights, tied or averaged over the symmetries of what they read."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns
from pns_common.model.features import DIRECTED_28, FEATURE_SETS
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


def test_weights_come_from_the_given_generator_alone():
    torch.manual_seed(1)
    first, state = network(seed=5), torch.get_rng_state()
    torch.manual_seed(2)
    second = network(seed=5)
    for weight, again in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(weight, again)
    torch.manual_seed(1)
    assert torch.equal(torch.get_rng_state(), state)


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


@feature_sets
def test_the_network_answers_every_reading_of_an_edge_alike(features):
    group = FEATURE_SETS[features].symmetries
    network = model(features).network
    rows = torch.from_numpy(
        np.random.default_rng(0).normal(size=(50, network.group.order.shape[1]))
    )
    with torch.no_grad():
        plain = network(rows, 0.5)
        for order, signs, local in zip(group.order, group.signs, group.local, strict=True):
            turned = network(rows[:, order] * torch.from_numpy(signs), 0.5)
            expected = plain * torch.from_numpy(local)
            torch.testing.assert_close(turned, expected, rtol=0, atol=1e-14)
    assert torch.linalg.vector_norm(plain, dim=1).max() <= 0.5 * (1 + EXACT)
    assert torch.linalg.vector_norm(plain, dim=1).max() > 0.1


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


def test_only_what_the_mirror_leaves_is_free():
    network = random_network(0)
    free = sum(parameter.numel() for parameter in network.parameters())
    dense = sum(
        layer.weight.numel() + layer.bias.numel()
        for layer in network.modules()
        if isinstance(layer, torch.nn.Linear)
    )
    first, last = network.encoder[0], network.heads
    # Of the first layer half the rows; of the heads half the columns, and the whole bias.
    assert free == (dense - last.bias.numel()) // 2 + last.bias.numel()
    assert first.parametrizations.weight.original.numel() == first.weight.numel() // 2
