import numpy as np
import pytest

from pns_common import Mesh, refine
from pns_common.connectivity.topology import build_topology
from tests.support.meshes import grid
from train.baselines.quadric import quadric_edge_points, quadric_fit


def paraboloid(x, y):
    return 0.3 + x - 0.5 * y + 0.7 * x * x - 0.4 * x * y + 0.2 * y * y


def test_is_exact_on_paraboloids_along_its_axis():
    rng = np.random.default_rng(2)
    vertices, faces = grid(7)
    vertices[:, :2] += rng.uniform(-0.05, 0.05, (len(vertices), 2))
    vertices[:, 2] = paraboloid(*vertices[:, :2].T)
    topology = build_topology(faces, len(vertices))
    valence = np.bincount(topology.edges.reshape(-1))
    up = np.tile([0.0, 0, 1], (len(vertices), 1))
    placed = quadric_edge_points(vertices, topology.edges, up)
    # With fewer than five neighbours a paraboloid is not determined.
    known = (valence[topology.edges] >= 5).all(axis=1)
    assert known.sum() > 50
    np.testing.assert_allclose(placed[known, 2], paraboloid(*placed[known, :2].T), atol=1e-10)


def test_the_mean_of_both_ends_depends_on_the_order_of_neither():
    vertices, faces = grid(6, paraboloid)
    edges = build_topology(faces, len(vertices)).edges
    up = np.tile([0.0, 0, 1], (len(vertices), 1))
    forward = quadric_edge_points(vertices, edges, up)
    backward = quadric_edge_points(vertices, edges[:, ::-1], up)
    np.testing.assert_allclose(forward, backward, atol=1e-14)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_scales_with_the_mesh(scale):
    vertices, faces = grid(6, paraboloid)
    here = refine(Mesh(vertices, faces), quadric_fit(), 1, threads=1).mesh.vertices
    there = refine(Mesh(scale * vertices, faces), quadric_fit(), 1, threads=1).mesh.vertices
    np.testing.assert_allclose(there / scale, here, atol=1e-9)
