"""Directions of normals, where there are none, and which are one."""

import numpy as np
import pytest

from service.gltf.refine.control_mesh import joined_normals
from service.gltf.refine.normals import safe_unit


def test_rows_join_by_vertex_and_normal():
    rng = np.random.default_rng(0)
    directions = safe_unit(rng.standard_normal((40, 3)))
    which, vertex = rng.integers(0, 40, 400), rng.integers(0, 5, 400)
    # One vertex has a single row.
    vertex[7] = 5
    labels = joined_normals(vertex, directions[which])
    expected = (which[:, None] == which) & (vertex[:, None] == vertex)
    np.testing.assert_array_equal(labels[:, None] == labels, expected)


@pytest.mark.parametrize(("degrees", "are_one"), [(0.09, True), (0.11, False)])
def test_normals_within_a_tenth_of_a_degree_are_one(degrees, are_one):
    angle = np.radians(degrees)
    normals = np.array([[0.0, 0.0, 1.0], [np.sin(angle), 0.0, np.cos(angle)]])
    first, second = joined_normals(np.zeros(2, dtype=np.int64), normals)
    assert (first == second) == are_one
