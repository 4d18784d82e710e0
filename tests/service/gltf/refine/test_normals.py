"""Directions of normals, where there are none, and which are one."""

import numpy as np
import pytest

from pns_common.mesh.rows import number_by_first_appearance
from service.gltf.refine.control_mesh import joined_normals
from service.gltf.refine.normals import safe_unit


def test_vectors_without_direction_become_the_z_axis():
    vectors = np.array([[0.0, 0, 0], [0, -3, 0], [1e-12, 0, 0]])
    np.testing.assert_array_equal(safe_unit(vectors), [[0, 0, 1], [0, -1, 0], [0, 0, 1]])


def test_rows_join_by_vertex_and_normal():
    rng = np.random.default_rng(0)
    directions = safe_unit(rng.standard_normal((40, 3)))
    which, vertex = rng.integers(0, 40, 400), rng.integers(0, 5, 400)
    # One vertex has a single row.
    vertex[7] = 5
    labels = joined_normals(vertex, directions[which])
    expected = (which[:, None] == which) & (vertex[:, None] == vertex)
    np.testing.assert_array_equal(labels[:, None] == labels, expected)


def test_normals_that_differ_by_rounding_are_one_and_by_a_degree_are_two():
    def tilted(degrees):
        return [np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))]

    normals = np.array([tilted(0), tilted(0.01), tilted(1), tilted(1.01), tilted(-0.01)])
    labels = joined_normals(np.zeros(5, dtype=np.int64), normals)
    assert number_by_first_appearance(labels)[0].tolist() == [0, 0, 1, 1, 0]


@pytest.mark.parametrize(("degrees", "are_one"), [(0.09, True), (0.11, False)])
def test_normals_within_a_tenth_of_a_degree_are_one(degrees, are_one):
    angle = np.radians(degrees)
    normals = np.array([[0.0, 0.0, 1.0], [np.sin(angle), 0.0, np.cos(angle)]])
    first, second = joined_normals(np.zeros(2, dtype=np.int64), normals)
    assert (first == second) == are_one


def test_zeros_of_either_sign_are_one_normal():
    normals = np.array([[0.0, 0.0, 1.0], [-0.0, -0.0, 1.0]])
    labels = joined_normals(np.zeros(2, dtype=np.int64), normals)
    assert labels[0] == labels[1]


def test_directions_count_and_lengths_do_not():
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.01], [0.0, 0.0, 1e-30], [0.0, 0.0, 0.0]])
    labels = joined_normals(np.zeros(4, dtype=np.int64), normals)
    assert number_by_first_appearance(labels)[0].tolist() == [0, 0, 0, 1]
