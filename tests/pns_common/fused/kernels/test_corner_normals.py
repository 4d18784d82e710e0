"""What each kernel of corners' normals writes, against hand-made figures."""

import numpy as np
import pytest

from pns_common.fused.kernels.corner_normals import scale_to_unit, sum_corners, triangle_normals
from tests.support.kernels import WAYS

# A right angle at a, 45° at b and c; twice the area is 4.
POINTS = np.array([[1.0, 1, 5], [3, 1, 5], [1, 3, 5]])
# The second face's first triangle has no area, its second is that one.
FACES = np.array([[9, 9, 9, 9], [2, 0, 1, 0]], dtype=np.int32)
TRIANGLES = np.array([[1, 3, 1], [1, 2, 0]], dtype=np.int32)


@pytest.mark.parametrize("way", WAYS)
def test_a_triangle_has_its_unit_normal_and_the_terms_of_its_angles(way):
    normals, sides = np.full((2, 3), np.nan), np.full((3, 2), np.nan)
    WAYS[way](triangle_normals)(POINTS, FACES, TRIANGLES, 1, 2, normals, sides)
    np.testing.assert_array_equal(normals, [[0, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(sides, [[0, 4], [0, 0], [0, 4]])
    angles = np.degrees(np.arctan2(sides[0], sides[1:]))
    np.testing.assert_array_equal(angles[:, 1], [90, 45])


@pytest.mark.parametrize("way", WAYS)
def test_each_corner_adds_its_angle_times_the_normal_to_its_group(way):
    angles = np.array([[np.pi / 2, 0], [np.pi / 4, 0]])
    total, normals = np.zeros((3, 3)), np.array([[0.0, 0, 2], [1, 1, 1]])
    groups = np.array([[2, 1, 0]], dtype=np.int32)
    triangles = np.array([[2, 0, 2], [1, 1, 1]], dtype=np.int32)
    WAYS[way](sum_corners)(normals, angles, groups, triangles, 0, 3, total)
    expected = np.array([[0, 0, 1.5 * np.pi], [np.pi, np.pi, np.pi], [0, 0, np.pi / 2]])
    np.testing.assert_allclose(total, expected)
    # Who owns some of the groups adds to no other.
    total[:] = 0
    WAYS[way](sum_corners)(normals, angles, groups, triangles, 1, 2, total)
    np.testing.assert_allclose(total, [[0, 0, 0], expected[1], [0, 0, 0]])


@pytest.mark.parametrize("way", WAYS)
def test_sums_are_scaled_where_they_have_a_direction(way):
    total = np.array([[9.0, 9, 9], [0, 3, 4], [1e-10, 0, 0], [9, 9, 9]])
    WAYS[way](scale_to_unit)(1, 3, total)
    np.testing.assert_allclose(total, [[9, 9, 9], [0, 0.6, 0.8], [0, 0, 0], [9, 9, 9]])
