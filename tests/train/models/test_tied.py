"""Tied weights: a dense network that has the symmetry exactly, before and after training."""

import copy

import numpy as np
import pytest
import torch

from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, check_parity
from pns_common import Mesh, pns, refine
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.ring_features import RING_10
from pns_common.models.card import ModelCard
from pns_common.runtimes.onnx_model import model_from_bytes
from pns_common.runtimes.tied_network import TiedNetwork
from tests.support.meshes import bumpy_sphere
from tests.support.networks import SCALE_FREE_CARD
from train.models.networks import unit_correction
from train.models.tied import TiedNet, product
from train.models.torch_model import TorchModel

GROUPS = {
    "edges": FEATURE_SETS["signed-18"].symmetries,
    "unsigned edges": FEATURE_SETS["paper-5"].symmetries,
    "vertices": RING_10.symmetries,
}
SIZES = {"edges": 8, "unsigned edges": 4, "vertices": 2}


def tied(name, copies=(4, 4), seed=0):
    return TiedNet(GROUPS[name], copies, "smoothstep", torch.Generator().manual_seed(seed))


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


def card(**changes):
    return ModelCard(**{**vars(SCALE_FREE_CARD), **changes})


def test_the_file_is_an_ordinary_dense_network_that_says_the_same():
    edges, vertices = trained(tied("edges")), trained(tied("vertices", (12, 12)))
    data = model_bytes(edges, card(), vertices)
    loaded = model_from_bytes(data, "tied")
    assert isinstance(loaded._network, TiedNetwork)  # proved to be tied, entry by entry
    parity = check_parity(loaded, edges, vertex_network=vertices)
    assert parity.difference <= TOLERANCE
    # One row an edge from end to end: nothing is averaged.
    assert b"signed_mean" not in data
    mesh = Mesh(*bumpy_sphere())
    model = TorchModel("tied", card(), edges, vertices)
    from_file, expected = (
        refine(mesh, pns(operator), 2).mesh.vertices for operator in (loaded, model)
    )
    np.testing.assert_allclose(from_file, expected, rtol=0, atol=1e-6)


def test_a_mesh_mirrored_turned_over_and_renumbered_gives_the_same_surface():
    """The whole rule, in double precision: what the group is for."""
    edges, vertices = trained(tied("edges")).double(), trained(tied("vertices")).double()
    scheme = pns(TorchModel("tied", card(), edges, vertices))
    points, faces = bumpy_sphere(0, bump=0.1)
    positions = refine(Mesh(points, faces), scheme, 1).mesh.vertices[: len(points)]
    mirror = np.array([1.0, 1.0, -1.0])
    mirrored = refine(Mesh(points * mirror, faces[:, ::-1]), scheme, 1).mesh.vertices[: len(points)]
    np.testing.assert_allclose(mirrored * mirror, positions, rtol=0, atol=1e-12)
    over = refine(Mesh(points, faces[:, ::-1]), scheme, 1).mesh.vertices[: len(points)]
    np.testing.assert_allclose(over, positions, rtol=0, atol=1e-12)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(points))
    renumbered = np.argsort(order)[rng.permutation(faces)]
    again = refine(Mesh(points[order], renumbered), scheme, 1)
    assert again.ratio.max() > 0.01
    np.testing.assert_allclose(again.mesh.vertices[: len(points)], positions[order], atol=1e-12)


def test_gradients_reach_every_free_weight_through_the_operator_callable():
    network = tied("edges")
    rows = torch.randn(40, 18, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    unit_correction(network)(rows).square().sum().backward()
    last_bias = network.linear_layers[-1].parametrizations.bias.original
    for parameter in network.parameters():
        assert (parameter.grad.abs().max() > 0) == (parameter is not last_bias)
