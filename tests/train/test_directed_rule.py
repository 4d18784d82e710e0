"""The kernels of directed edges agree with the rule written once more in torch."""

import numpy as np
import pytest
import torch

from pns_common import Creases, Scheme
from pns_common.mesh.topology import build_topology
from pns_common.operator import formula
from pns_common.operator.directed import DirectedNetworks, ask, directed_features
from pns_common.operator.level import Level
from pns_common.operator.sharpness import with_sharp_edges
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from tests.support.networks import DEFAULT_CARD
from tests.train.test_reference import SEEDS, random_mesh
from train.connectivity import connect
from train.directed_rule import DirectedEdges, DirectedRule
from train.fitting.control_mesh import by_way
from train.models.directed import DirectedNet
from train.models.torch_model import answered, layers_of
from train.reference import Surroundings


def level_of(points, faces, creases):
    """Return the library's level of a mesh."""
    topology = build_topology(faces, len(points))
    topology = topology.with_creases(topology.rows_of(creases))
    return Level(points, topology, LOOP, 1.0, Blocks())


@pytest.fixture(params=SEEDS)
def both(request):
    """Return a random mesh as the library's level and as the reference's edges."""
    points, faces, creases = random_mesh(request.param)
    level = level_of(points, faces, creases[:0])
    edges = DirectedEdges(Surroundings(connect(faces, len(points)), torch.tensor(points)))
    return request.param, level, edges


def network(seed, scale=1.0):
    """Return a network with random weights, in double precision."""
    net = DirectedNet(torch.Generator().manual_seed(seed), width=8, hidden=12).double()
    generator = torch.Generator().manual_seed(seed + 1)
    with torch.no_grad():
        for weights in net.parameters():
            weights.copy_(scale * torch.randn(weights.shape, generator=generator))
    return net.requires_grad_(False)


def as_networks(net):
    """Return the parts of a torch network as the library asks for them."""
    own = layers_of(net, DEFAULT_CARD)

    def rows(given):
        return lambda read: answered(own[given], torch.from_numpy(np.asarray(read, float))).numpy()

    rounds = [(rows(f"pooled_{n}"), rows(f"messages_{n}")) for n in (1, 2)]
    return DirectedNetworks(rows("features"), tuple(rounds), rows("states"), net.width, net.hidden)


def test_features_agree(both):
    _, level, edges = both
    level.measure(rings=True)
    made = directed_features(level, 0, len(level.topology.edges))
    np.testing.assert_allclose(edges.features, by_way(made), rtol=1e-6, atol=1e-6)


def test_answers_agree(both):
    seed, level, edges = both
    net = network(seed, 0.4)
    heads = net(edges.features, edges.graph)
    made = ask(level, as_networks(net))
    asked = edges.over_edges(edges.world(heads[:, :3]))
    np.testing.assert_allclose(asked, made.edges, rtol=1e-4, atol=1e-4)
    leaving = edges.mean_leaving(edges.world(heads[:, 3:6]))
    np.testing.assert_allclose(leaving, made.vertices, rtol=1e-4, atol=1e-4)
    sharpness = torch.sigmoid(edges.over_edges(heads[:, 6:7]))[:, 0]
    np.testing.assert_allclose(sharpness, made.sharpness, rtol=1e-4, atol=1e-4)
    corners = torch.sigmoid(edges.mean_leaving(heads[:, 7:8]))[:, 0]
    np.testing.assert_allclose(corners, made.corners, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("budget", [0.1, 10.0])
@pytest.mark.parametrize("creased", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_step_agrees(seed, creased, budget):
    """x, s and the ratio, of networks that ask for more than the budget and than none."""
    points, faces, creases = random_mesh(seed)
    creases = creases if creased else creases[:0]
    net, numbers = (
        network(seed, 0.3),
        {
            "gate_sharpness": 1e3,
            "vertex_gate_sharpness": 1e2,
            "budget": budget,
            "curve_strength": 0.7,
            "network_scale": 0.4,
            "fold_angle": 40.0,
        },
    )
    rule = formula.DirectedRule(as_networks(net), **numbers)
    scheme = Scheme("pns", LOOP, rule, learned_levels=1)
    level = with_sharp_edges(level_of(points, faces, creases), Creases(learned=True), scheme)
    made = formula.directed_level(level, rule)
    mesh = connect(faces, len(points), creases)
    step = DirectedRule(net, **numbers)(torch.tensor(points), mesh)
    np.testing.assert_allclose(step.base, made.points - made.displacement, rtol=0, atol=1e-4)
    np.testing.assert_allclose(step.points, made.points, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(step.scale, made.scale)
    np.testing.assert_allclose(step.ratio, made.ratio, rtol=0, atol=1e-4)
