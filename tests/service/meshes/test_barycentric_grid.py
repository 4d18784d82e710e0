"""The grid of a triangle's descendants, and connectivities spread over it."""

import numpy as np
import pytest

from pns_common.mesh.topology import build_topology, split_faces
from pns_common.parallel import Blocks
from service.meshes.barycentric_grid import barycentric_grid
from service.meshes.split_connectivity import split_connectivity


@pytest.mark.parametrize("levels", range(1, 7))
def test_points_are_all_barycentric_points_once(levels):
    grid, n = barycentric_grid(levels), 2**levels
    expected = {(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)}
    assert {tuple(point) for point in grid.points.tolist()} == expected
    assert len(grid.points) == len(expected)
    assert grid.faces.shape == (4**levels, 3)
    np.testing.assert_array_equal(grid.faces.reshape(-1)[grid.slot], np.arange(len(grid.points)))
    assert sorted([0, 1, 2, *grid.sides.reshape(-1), *grid.inner]) == list(range(len(expected)))


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_sides_run_from_corner_to_corner(levels):
    grid, n = barycentric_grid(levels), 2**levels
    for side in range(3):
        start, end = grid.points[[side, (side + 1) % 3]]
        for step, point in enumerate(grid.sides[side], start=1):
            np.testing.assert_array_equal(grid.points[point] * n, start * (n - step) + end * step)


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_reordered_corners_name_the_same_points(levels):
    grid = barycentric_grid(levels)
    corners = np.random.default_rng(0).standard_normal((3, 3))
    for i, j, k in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]:
        mine, other = grid.points @ corners[[i, j, k]], grid.points @ corners
        np.testing.assert_allclose(mine, other[grid.reorder[3 * i + j]], atol=1e-12)


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
