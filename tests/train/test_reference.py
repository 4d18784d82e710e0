"""The kernels agree with the formula written once more in torch, on every class of edge."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import Delaunay

from pns_common.mesh.topology import build_topology, split_triangles
from pns_common.model.features import FEATURE_SETS
from pns_common.operator.formula import PaperRule as LibraryRule
from pns_common.operator.formula import edge_inputs
from pns_common.operator.level import Level
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from train.connectivity import connect
from train.data.icosphere import icosphere
from train.loop_masks import loop_points
from train.reference import (
    EDGE_FEATURES,
    PaperRule,
    Surroundings,
    edge_frames,
    read_edges,
)

SEEDS = range(12)
CLOSE = {"rtol": 0, "atol": 1e-12}


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


def network(columns, seed):
    """Return a random network for arrays and for tensors alike."""
    rng = np.random.default_rng(seed)
    first, last = rng.standard_normal((columns, 3)), rng.standard_normal((3, 3))

    def answer(features):
        if isinstance(features, np.ndarray):
            return np.tanh(features @ first) @ last
        return torch.tanh(features @ torch.from_numpy(first)) @ torch.from_numpy(last)

    return answer


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


def test_edges_faces_and_rings_agree(both):
    _, level, _, mesh = both
    topology = level.topology
    np.testing.assert_array_equal(mesh.edges, topology.edges)
    np.testing.assert_array_equal(mesh.face_edges, topology.face_edges)
    np.testing.assert_array_equal(mesh.interior, topology.interior)
    np.testing.assert_array_equal(mesh.ringed & (mesh.sharpest[0][:, 1] < 1), level.ringed)
    split = split_triangles(topology, Blocks())
    np.testing.assert_array_equal(mesh.split(), split.faces)


def test_loops_masks_agree(both):
    _, level, points, mesh = both
    topology = level.topology
    np.testing.assert_allclose(
        loop_points(points, mesh), LOOP.place(level.points, topology, Blocks()), **CLOSE
    )


@pytest.mark.parametrize("name", EDGE_FEATURES)
def test_frames_and_features_agree(both, name):
    _, level, points, mesh = both
    columns, seen, symmetric = EDGE_FEATURES[name], FEATURE_SETS[name], name != "paper-5"
    rule = LibraryRule(network(seen.count, 0), seen, symmetric, 10.0, 0.5)
    ours = edge_inputs(level, rule, level.topology.interior)
    around = Surroundings(mesh, points)
    edges = read_edges(around, first_face=not symmetric)
    frames = edge_frames(edges, first_face=not symmetric)
    rows = mesh.interior
    np.testing.assert_allclose(
        columns(around, edges, frames)[rows], ours.features, rtol=1e-12, atol=1e-12
    )
    axes = frames.axes[rows].transpose(1, 2).reshape(-1, 9)
    np.testing.assert_allclose(axes, ours.basis, **CLOSE)


@pytest.mark.parametrize("name", EDGE_FEATURES)
def test_a_step_of_the_paper_agrees(both, name):
    seed, level, points, mesh = both
    columns, seen, symmetric = EDGE_FEATURES[name], FEATURE_SETS[name], name != "paper-5"
    answer = network(seen.count, seed)
    made = LibraryRule(answer, seen, symmetric, 10.0, 0.5)(level)
    step = PaperRule(answer, 0.5, 10.0, columns, first_face=not symmetric)(points, mesh)
    np.testing.assert_allclose(step.points, made.points, **CLOSE)
    np.testing.assert_allclose(step.ratio, made.ratio, **CLOSE)
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
    assert (gradient * direction).sum().item() == pytest.approx(
        (ahead - behind).item() / 2e-6, rel=1e-5
    )


def test_soft_masks_agree_with_the_kernels():
    points, faces, _ = random_mesh(1)
    mesh = connect(faces, len(points))
    sharpness = torch.rand(len(mesh.edges), generator=torch.Generator().manual_seed(3)).double()
    topology = build_topology(faces, len(points)).with_sharpness(sharpness.numpy())
    soft = replace(mesh, sharpness=torch.where(mesh.paired, sharpness, 1.0))
    np.testing.assert_allclose(
        loop_points(torch.tensor(points), soft), LOOP.place(points, topology, Blocks()), **CLOSE
    )
