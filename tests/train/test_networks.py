"""Networks: bounded for any weights, tied or averaged over the symmetries of what they read."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ParameterError, pns
from pns_common.model.features import FEATURE_SETS, RING_10
from tests.support.control_points import refine
from tests.support.meshes import TETRAHEDRON, bumpy_sphere, manifolds
from tests.support.networks import DEFAULT_CARD
from tests.support.renumbering import ASSETS, MIRROR, asset, mirrored, renumbered, turned_over
from train.certificates.equivariance import well_conditioned
from train.models.from_recipe import initial_network, initial_vertex_network
from train.models.networks import ACTIVATIONS, BoundedNet, unit_correction
from train.models.recipe import one_step, scale_free_parts
from train.models.recipes import general, paper, signed
from train.models.tied import TiedNet, product
from train.models.torch_model import TorchModel, recipe_model


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


def test_short_outputs_are_only_scaled():
    net = network()
    features = torch.zeros(1, 5)
    z = net.net(features)
    assert torch.linalg.vector_norm(z) < 1
    torch.testing.assert_close(net(features, 0.25), 0.25 * z, rtol=0, atol=0)


def test_gelu_is_the_exact_one():
    x = torch.linspace(-6, 6, 101, dtype=torch.float64)
    expected = [0.5 * v * (1 + math.erf(v / math.sqrt(2))) for v in x.tolist()]
    np.testing.assert_allclose(ACTIVATIONS["gelu"]()(x), expected, rtol=0, atol=1e-15)


def test_weights_come_from_the_given_generator_alone():
    torch.manual_seed(1)
    first, state = network(seed=5), torch.get_rng_state()
    torch.manual_seed(2)
    second = network(seed=5)
    for weight, again in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(weight, again)
    torch.manual_seed(1)
    assert torch.equal(torch.get_rng_state(), state)


def test_weights_keep_to_torchs_own_initial_range():
    for layer in network(hidden=(64,)).linear_layers:
        bound = layer.in_features**-0.5
        assert 0.9 * bound < layer.weight.abs().max() <= bound
        assert layer.bias.abs().max() <= bound


@pytest.mark.parametrize("own", [torch.float32, torch.float64])
def test_the_operator_gets_its_own_precision_back(own):
    net = network().to(own)
    features = torch.rand(4, 5, dtype=torch.float64)
    correction = unit_correction(net)(features)
    assert correction.dtype == torch.float64
    torch.testing.assert_close(correction, net(features.to(own), 1.0).double(), rtol=0, atol=0)


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
@pytest.mark.parametrize("name", ASSETS)
def test_numbering_and_mirrors_change_nothing_on_assets(features, name):
    mesh, subject = asset(name), model(features)
    assert apart(mesh, renumbered(mesh, 0), subject) < EXACT
    assert apart(mesh, mirrored(mesh), subject, reflected) < EXACT
    if features in SIGNED:
        assert apart(mesh, turned_over(mesh), subject) < EXACT


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


def test_unsigned_features_cannot_tell_outside_from_inside():
    """Their group has no turn-over: with it every correction along N would average away."""
    mesh, subject = Mesh(*bumpy_sphere()), model("paper-5")
    assert apart(mesh, turned_over(mesh), subject) > 1e-4


def test_a_folded_pair_of_faces_is_degenerate_in_both_orientations():
    folded = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0.3, 1, 0], [0.4, 1, 0]]), TETRAHEDRON[:2])
    for orientation, moved in (("first-face", True), ("symmetric", False)):
        refined = refine(folded, pns(model(orientation=orientation)), 1)
        assert refined.report["levels"][0]["degenerate_frames"] == 1
        assert (refined.ratio.max() > 0) == moved


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


def test_weights_of_both_kinds_of_network_are_the_same():
    """Averaging adds nothing to a checkpoint."""
    keys = initial_network(replace(paper(), orientation="symmetric")).state_dict().keys()
    assert keys == initial_network(paper()).state_dict().keys()
    assert isinstance(model().network, BoundedNet)


GROUPS = {
    "edges": FEATURE_SETS["signed-18"].symmetries,
    "unsigned edges": FEATURE_SETS["paper-5"].symmetries,
    "vertices": RING_10.symmetries,
}
SIZES = {"edges": 8, "unsigned edges": 4, "vertices": 2}


def tied(name, copies=(4, 4), seed=0):
    return TiedNet(GROUPS[name], copies, "silu", torch.Generator().manual_seed(seed))


def trained(network, steps=5):
    """After some steps on a task without any symmetry."""
    optimiser = torch.optim.Adam(network.parameters(), lr=0.1)
    width = network.linear_layers[0].in_features
    generator = torch.Generator().manual_seed(1)
    for _ in range(steps):
        rows = torch.randn(64, width, generator=generator)
        loss = (network(rows, 1.0) - rows[:, :3]).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return network


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("copies", [(3,), (4, 4), (2, 3, 5)])
def test_answers_turn_with_the_features_before_and_after_training(name, copies):
    group = GROUPS[name]
    rows = torch.from_numpy(np.random.default_rng(0).standard_normal((50, group.order.shape[1])))
    for network in (tied(name, copies), trained(tied(name, copies))):
        exact = copy.deepcopy(network).double()
        z = exact.raw(rows)
        assert z.abs().max() > 1e-2
        for order, signs, local in zip(group.order, group.signs, group.local, strict=True):
            turned = exact.raw(rows[:, order] * torch.from_numpy(signs))
            torch.testing.assert_close(turned, z * torch.from_numpy(local), rtol=0, atol=1e-12)


def test_a_dense_network_would_not():
    group = GROUPS["edges"]
    dense = tied("edges")
    weights = [
        (layer.weight.detach().clone(), layer.bias.detach()) for layer in dense.linear_layers
    ]
    weights[1][0][0, 0] += 0.1
    rows = torch.randn(9, 18, generator=torch.Generator().manual_seed(0))

    def raw(values):
        for number, (weight, bias) in enumerate(weights):
            values = values @ weight.T + bias
            values = torch.nn.functional.gelu(values) if number < len(weights) - 1 else values
        return values

    g = 3
    turned = raw(rows[:, group.order[g]] * torch.from_numpy(group.signs[g]).float())
    assert (turned - raw(rows) * torch.from_numpy(group.local[g]).float()).abs().max() > 1e-4


@pytest.mark.parametrize("name", GROUPS)
def test_the_group_is_numbered_as_its_products_say(name):
    group, size = GROUPS[name], SIZES[name]
    assert len(group.order) == size
    rows = np.random.default_rng(0).standard_normal(group.order.shape[1])

    def act(g, values):
        return group.signs[g] * values[group.order[g]]

    for g in range(size):
        for h in range(size):
            np.testing.assert_array_equal(act(g, act(h, rows)), act(product(size)[g, h], rows))


@pytest.mark.parametrize("name", GROUPS)
def test_there_are_as_many_free_weights_as_the_group_leaves(name):
    """A |G|th of the dense ones, layer by layer; the last bias is not divided."""
    network, size = tied(name), SIZES[name]
    dense = sum(layer.weight.numel() + layer.bias.numel() for layer in network.linear_layers)
    free = sum(parameter.numel() for parameter in network.parameters())
    assert free == (dense - 3) // size + 3


def test_the_same_seed_gives_the_same_network_and_another_another():
    first, same, other = tied("edges"), tied("edges"), tied("edges", seed=1)
    for a, b in zip(first.parameters(), same.parameters(), strict=True):
        assert torch.equal(a, b)
    assert not torch.equal(first.linear_layers[0].weight, other.linear_layers[0].weight)


def test_weights_survive_a_state_dictionary():
    network, fresh = trained(tied("edges")), tied("edges", seed=7)
    fresh.load_state_dict(network.state_dict())
    rows = torch.randn(5, 18, generator=torch.Generator().manual_seed(0))
    assert torch.equal(network(rows, 1.0), fresh(rows, 1.0))


def test_a_mesh_mirrored_turned_over_and_renumbered_gives_the_same_surface():
    """The whole rule, in double precision: what the group is for."""
    edges, vertices = trained(tied("edges")).double(), trained(tied("vertices")).double()
    scheme = pns(TorchModel("tied", DEFAULT_CARD, edges, vertices))
    points, faces = bumpy_sphere(0, bump=0.1)
    positions = refine(Mesh(points, faces), scheme, 1).mesh.vertices[: len(points)]
    mirror = np.array([1.0, 1.0, -1.0])
    mirrored = refine(Mesh(points * mirror, faces[:, ::-1]), scheme, 1).mesh.vertices[: len(points)]
    np.testing.assert_allclose(mirrored * mirror, positions, rtol=0, atol=1e-12)
    over = refine(Mesh(points, faces[:, ::-1]), scheme, 1).mesh.vertices[: len(points)]
    np.testing.assert_allclose(over, positions, rtol=0, atol=1e-12)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(points))
    renumbered_faces = np.argsort(order)[rng.permutation(faces)]
    again = refine(Mesh(points[order], renumbered_faces), scheme, 1)
    assert again.ratio.max() > 0.01
    np.testing.assert_allclose(again.mesh.vertices[: len(points)], positions[order], atol=1e-12)


def test_gradients_reach_every_free_weight_through_the_operator_callable():
    network = tied("edges")
    rows = torch.randn(40, 18, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    unit_correction(network)(rows).square().sum().backward()
    last_bias = network.linear_layers[-1].parametrizations.bias.original
    for parameter in network.parameters():
        assert (parameter.grad.abs().max() > 0) == (parameter is not last_bias)


def test_a_scale_free_recipe_has_tied_networks_that_are_silent_before_training():
    for network, features in (
        (initial_network(general()), 18),
        (initial_vertex_network(general()), 10),
    ):
        assert isinstance(network, TiedNet)
        rows = torch.from_numpy(np.random.default_rng(0).normal(size=(7, features))).float()
        assert not network(rows, 1.0).any()


@pytest.mark.parametrize("hidden", [(50, 48), (4,), (0,)])
def test_widths_that_symmetries_do_not_divide_are_refused(hidden):
    """50 came out as 48, and the card said 50."""
    with pytest.raises(ParameterError, match=r"hidden.*multiples of 8.*signed-18"):
        initial_network(replace(general(), hidden=hidden))


def test_only_a_scale_free_recipe_has_the_parts_of_one():
    recipe = general()
    assert scale_free_parts(recipe) == (recipe.scale_free, recipe.vertex)
    with pytest.raises(ParameterError, match="scale-free"):
        scale_free_parts(signed())


def test_one_step_is_refused_where_a_recipe_trains_to_the_limit():
    assert one_step(paper()).dataset == "ridge-training"
    with pytest.raises(ParameterError, match="one step"):
        one_step(general())
