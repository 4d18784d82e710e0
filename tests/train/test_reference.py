"""The kernels agree with the formulas written once more in torch, on every class of edge."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import Delaunay

from pns_common import Creases, Scheme
from pns_common.mesh.topology import build_topology, split_triangles
from pns_common.model.features import FEATURE_SETS
from pns_common.operator import formula
from pns_common.operator.directed import DirectedNetworks, ask, directed_features
from pns_common.operator.formula import PaperRule as LibraryRule
from pns_common.operator.formula import edge_inputs
from pns_common.operator.level import Level
from pns_common.operator.sharpness import with_sharp_edges
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from tests.support.networks import DEFAULT_CARD
from train.connectivity import connect
from train.data.icosphere import icosphere
from train.directed_rule import DirectedEdges, DirectedRule
from train.fitting.control_mesh import by_way
from train.loop_masks import loop_points
from train.models.directed import DirectedNet
from train.models.torch_model import answered, layers_of
from train.reference import EDGE_FEATURES, PaperRule, Surroundings, edge_frames, read_edges

SEEDS = range(12)
CLOSE, NEAR = {"rtol": 0, "atol": 1e-12}, {"rtol": 1e-4, "atol": 1e-4}


def random_mesh(seed):
    """Return vertices, faces and a sixth of the edges: open, closed, soup, or degenerate."""
    rng = np.random.default_rng(seed)
    plane = rng.uniform(-1, 1, (60, 2))
    points = np.column_stack([plane, 0.4 * np.sin(3 * plane[:, 0])])
    faces = Delaunay(plane).simplices.astype(np.int64)
    kind = seed % 4
    if kind == 0:
        points[:, 2] += 0.05 * rng.standard_normal(60)
    elif kind == 1:
        mesh = icosphere(2)
        faces, shake = mesh.faces, 0.1 * rng.standard_normal((len(mesh.vertices), 1))
        points = mesh.vertices * (1 + shake)
    elif kind == 2:
        points = rng.standard_normal((14, 3))
        faces = np.array([rng.choice(14, 3, replace=False) for _ in range(30)])
    else:
        holes = np.delete(faces, rng.choice(len(faces), 8), axis=0)
        faces = np.concatenate([holes, holes[:2, [0, 2, 1]], [[0, 1, 2], [3, 3, 4]]])
        points[5] = points[6]
    mesh = connect(faces, len(points))
    inner = rng.permutation(mesh.interior.numpy())
    return points, faces, mesh.edges.numpy()[inner[: len(inner) // 6]]


@pytest.fixture(params=[(seed, creased) for seed in SEEDS for creased in (False, True)])
def both(request):
    """Return one random mesh as the library's level and as the reference's."""
    seed, creased = request.param
    points, faces, creases = random_mesh(seed)
    creases = creases if creased else creases[:0]
    topology = build_topology(faces, len(points))
    topology = topology.with_creases(topology.rows_of(creases))
    level = Level(points, topology, LOOP, 1.0, Blocks())
    return seed, level, torch.tensor(points), connect(faces, len(points), creases)


def test_edges_faces_rings_and_loops_masks_agree(both):
    _, level, points, mesh = both
    topology = level.topology
    np.testing.assert_array_equal(mesh.edges, topology.edges)
    np.testing.assert_array_equal(mesh.face_edges, topology.face_edges)
    np.testing.assert_array_equal(mesh.interior, topology.interior)
    np.testing.assert_array_equal(mesh.ringed & (mesh.sharpest[0][:, 1] < 1), level.ringed)
    np.testing.assert_array_equal(mesh.split(), split_triangles(topology, Blocks()).faces)
    placed = LOOP.place(level.points, topology, Blocks())
    np.testing.assert_allclose(loop_points(points, mesh), placed, **CLOSE)
    w = torch.rand(len(mesh.edges), generator=torch.Generator().manual_seed(3)).double()
    w = torch.maximum(w, mesh.sharpness)
    placed = LOOP.place(level.points, topology.with_sharpness(w.numpy()), Blocks())
    np.testing.assert_allclose(loop_points(points, replace(mesh, sharpness=w)), placed, **CLOSE)


# --- the paper's rule -----------------------------------------------------------------------------


def network(columns, seed):
    """Return a random network for arrays and for tensors alike."""
    rng = np.random.default_rng(seed)
    first, last = rng.standard_normal((columns, 3)), rng.standard_normal((3, 3))

    def answer(features):
        if isinstance(features, np.ndarray):
            return np.tanh(features @ first) @ last
        return torch.tanh(features @ torch.from_numpy(first)) @ torch.from_numpy(last)

    return answer


@pytest.mark.parametrize("name", EDGE_FEATURES)
def test_frames_features_and_a_step_of_the_paper_agree(both, name):
    seed, level, points, mesh = both
    columns, seen, symmetric = EDGE_FEATURES[name], FEATURE_SETS[name], name != "paper-5"
    rule = LibraryRule(network(seen.count, seed), seen, symmetric, 10.0, 0.5)
    inputs = edge_inputs(level, rule, level.topology.interior)
    around, rows = Surroundings(mesh, points), mesh.interior
    edges = read_edges(around, first_face=not symmetric)
    frames = edge_frames(edges, first_face=not symmetric)
    features = columns(around, edges, frames)[rows]
    np.testing.assert_allclose(features, inputs.features, rtol=1e-12, atol=1e-12)
    axes = frames.axes[rows].transpose(1, 2).reshape(-1, 9)
    np.testing.assert_allclose(axes, inputs.basis, **CLOSE)
    made = rule(level)
    step = PaperRule(rule.network, 0.5, 10.0, columns, first_face=not symmetric)(points, mesh)
    for ours, theirs in ((made.points, step.points), (made.ratio, step.ratio)):
        np.testing.assert_allclose(theirs, ours, **CLOSE)
    np.testing.assert_allclose(step.gate, made.gate, **CLOSE)


def test_gradients_through_positions_are_derivatives():
    points, faces, creases = random_mesh(0)
    mesh = connect(faces, len(points), creases)
    rule = PaperRule(network(18, 0), 10.0, 10.0, EDGE_FEATURES["signed-18"])
    start = torch.tensor(points, requires_grad=True)
    direction = torch.randn(start.shape, generator=torch.Generator().manual_seed(0)).double()
    weights = torch.randn(rule(start, mesh).points.shape).double()
    (gradient,) = torch.autograd.grad((weights * rule(start, mesh).points).sum(), start)
    ahead, behind = (
        (weights * rule(start.detach() + sign * 1e-6 * direction, mesh).points).sum()
        for sign in (1, -1)
    )
    expected = (ahead - behind).item() / 2e-6
    assert (gradient * direction).sum().item() == pytest.approx(expected, rel=1e-5)


# --- the rule of directed edges -------------------------------------------------------------------


def directed_network(seed, scale):
    """Return a network with random weights in double precision, and as the library asks it."""
    net = DirectedNet(torch.Generator().manual_seed(seed), width=8, hidden=12).double()
    generator = torch.Generator().manual_seed(seed + 1)
    with torch.no_grad():
        for weights in net.parameters():
            weights.copy_(scale * torch.randn(weights.shape, generator=generator))
    own = layers_of(net.requires_grad_(False), DEFAULT_CARD)

    def rows(given):
        return lambda read: answered(own[given], torch.from_numpy(np.asarray(read, float))).numpy()

    rounds = tuple((rows(f"pooled_{n}"), rows(f"messages_{n}")) for n in (1, 2))
    return net, DirectedNetworks(rows("features"), rounds, rows("states"), net.width, net.hidden)


def test_features_and_answers_of_directed_edges_agree(both):
    seed, level, points, mesh = both
    if len(level.topology.crease_edges):
        return  # networks see no creases
    net, networks = directed_network(seed, 0.4)
    edges = DirectedEdges(Surroundings(mesh, points))
    level.measure(rings=True)
    features = directed_features(level, 0, len(level.topology.edges))
    np.testing.assert_allclose(edges.features, by_way(features), rtol=1e-6, atol=1e-6)
    heads, made = net(edges.features, edges.graph), ask(level, networks)
    for expected, answers in (
        (edges.over_edges(edges.world(heads[:, :3])), made.edges),
        (edges.mean_leaving(edges.world(heads[:, 3:6])), made.vertices),
        (torch.sigmoid(edges.over_edges(heads[:, 6:7]))[:, 0], made.sharpness),
        (torch.sigmoid(edges.mean_leaving(heads[:, 7:8]))[:, 0], made.corners),
    ):
        np.testing.assert_allclose(expected, answers, **NEAR)


@pytest.mark.parametrize("budget", [0.1, 10.0])
def test_a_step_of_directed_edges_agrees(both, budget):
    """x, s and the ratio, of networks that ask for more than the budget and than none."""
    seed, level, points, mesh = both
    net, networks = directed_network(seed, 0.3)
    numbers = {
        "gate_sharpness": 1e3,
        "vertex_gate_sharpness": 1e2,
        "budget": budget,
        "curve_strength": 0.7,
        "network_scale": 0.4,
        "fold_angle": 40.0,
    }
    rule = formula.DirectedRule(networks, **numbers)
    scheme = Scheme("pns", LOOP, rule, learned_levels=1)
    made = rule(with_sharp_edges(level, Creases(learned=True), scheme))
    step = DirectedRule(net, **numbers)(points, mesh)
    np.testing.assert_allclose(step.base, made.points - made.displacement, rtol=0, atol=1e-4)
    np.testing.assert_allclose(step.points, made.points, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(step.scale, made.scale)
    np.testing.assert_allclose(step.ratio, made.ratio, rtol=0, atol=1e-4)
