"""The grid of a triangle's descendants, and connectivities spread over it."""

import numpy as np
import pytest

from pns_common.mesh.topology import build_topology, split_faces
from pns_common.parallel import Blocks
from service.meshes.barycentric_grid import barycentric_grid
from service.meshes.split_connectivity import split_connectivity


def level_by_level(faces, values, levels):
    """Corner positions of all refined faces, by splitting one level after the other."""
    for _ in range(levels):
        topology = build_topology(faces, len(values))
        a, b = topology.edges.T
        values = np.concatenate([values, (values[a] + values[b]) / 2])
        faces = split_faces(topology, Blocks())
    return faces, values


FACES = np.array([[0, 1, 2], [2, 1, 3], [3, 4, 2], [5, 2, 0], [2, 5, 6], [1, 2, 7]])


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_a_spread_equals_splitting_level_by_level(levels):
    values = np.random.default_rng(1).standard_normal((8, 5))
    own = split_connectivity(FACES, 8, barycentric_grid(levels))
    faces, expected = level_by_level(FACES, values, levels)
    linear = own.linear(values)
    assert len(linear) == own.count == len(expected)
    np.testing.assert_allclose(linear[own.refined_faces], expected[faces], atol=1e-12)
    # The same corners share a vertex.
    pairs = np.stack([own.refined_faces.reshape(-1), faces.reshape(-1)], axis=1)
    assert len(np.unique(pairs, axis=0)) == own.count


@pytest.mark.parametrize("levels", [1, 2])
def test_nearest_copies_a_nearest_corner(levels):
    corners = np.arange(8)[:, None]
    own = split_connectivity(FACES, 8, barycentric_grid(levels))
    # One weight a corner: linear gives each vertex its share in every corner.
    share = own.linear(np.eye(8))
    nearest = own.nearest(corners)[:, 0]
    assert nearest.dtype == corners.dtype
    np.testing.assert_array_equal(share[np.arange(own.count), nearest], share.max(axis=1))
    np.testing.assert_array_equal(nearest[:8], np.arange(8))
