"""What each kernel of corners' normals writes, against hand-made figures."""

import numpy as np
import pytest

from pns_common.fused.kernels.corner_normals import (
    add_corners,
    measure_triangles,
    normals_and_angles,
    scale_to_unit,
)
from pns_common.geometry.angles import angle_between
from tests.support.kernels import WAYS

# A right angle at a, 45° at b and c; twice the area is 4.
POINTS = np.array([[1.0, 1, 5], [3, 1, 5], [1, 3, 5]])
# The second face's first triangle has no area, its second is that one.
FACES = np.array([[9, 9, 9, 9], [2, 0, 1, 0]], dtype=np.int32)
TRIANGLES = np.array([[1, 3, 1], [1, 2, 0]], dtype=np.int32)


@pytest.mark.parametrize("way", WAYS)
def test_a_triangle_has_its_area_vector_and_the_terms_of_its_angles(way):
    measured = np.full((6, 2), np.nan)
    WAYS[way](measure_triangles)(POINTS, FACES, TRIANGLES, 1, 2, measured)
    np.testing.assert_array_equal(measured[:3].T, [[0, 0, 0], [0, 0, 4]])
    np.testing.assert_array_equal(measured[3:5].T, [[0, 0], [0, 4]])


@pytest.mark.parametrize("way", WAYS)
def test_area_vectors_become_unit_normals_and_products_angles(way):
    rng = np.random.default_rng(0)
    measured = rng.standard_normal((6, 100)) * 10.0 ** rng.integers(-9, 9, (6, 100))
    measured[:3, 0] = 0
    expected, area = measured.copy(), np.sqrt((measured[:3] ** 2).sum(axis=0))
    expected[:3] /= np.where(area > 0, area, 1)
    expected[3:5], expected[5] = angle_between(area, measured[3:5]), area
    WAYS[way](normals_and_angles)(measured)
    assert measured.tobytes() == expected.tobytes()


@pytest.mark.parametrize("way", WAYS)
def test_each_corner_adds_its_angle_times_the_normal_to_its_group(way):
    # Of the two triangles of the second face.
    normals, angles = np.array([[0.0, 0, 2], [1, 1, 1]]), np.array([[0.5, 0.25], [0, 0]]) * np.pi
    rows = np.vstack([normals.T, angles.T, [9, 9]])
    measured, total = np.ascontiguousarray(rows), np.zeros((3, 3))
    groups = np.array([[9, 9, 9], [2, 1, 0]], dtype=np.int32)
    triangles = np.array([[2, 0, 2], [1, 1, 1]], dtype=np.int32)
    WAYS[way](add_corners)(measured, groups, triangles, 1, 2, total)
    expected = np.array([[0, 0, 1.5 * np.pi], [np.pi, np.pi, np.pi], [0, 0, np.pi / 2]])
    np.testing.assert_allclose(total, expected)


@pytest.mark.parametrize("way", WAYS)
def test_sums_are_scaled_where_they_have_a_direction(way):
    total = np.array([[9.0, 9, 9], [0, 3, 4], [1e-10, 0, 0], [9, 9, 9]])
    WAYS[way](scale_to_unit)(1, 3, total)
    np.testing.assert_allclose(total, [[9, 9, 9], [0, 0.6, 0.8], [0, 0, 0], [9, 9, 9]])
