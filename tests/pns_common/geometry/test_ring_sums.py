"""Sums over the rings of vertices, against plain loops over faces and edges."""

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.geometry.ring_sums import divided, mean_normals, neighbour_mean, spokes
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid
from tests.support.plain_operator import PlainMesh


def test_mean_normals_are_weighted_by_area():
    points, faces = bumpy_sphere(1, subdivisions=0)
    expected = PlainMesh(points, faces).mean_normal
    np.testing.assert_allclose(mean_normals(points, faces), expected, atol=1e-14)


def test_mean_normals_are_one_long_where_faces_agree_and_none_without_area():
    points, faces = grid(4)
    lone = np.concatenate([points, [[9.0, 9, 9]]])
    expected = [[0, 0, 1]] * len(points) + [[0, 0, 0]]
    np.testing.assert_allclose(mean_normals(lone, faces), expected, atol=1e-15)


def test_spokes_leave_both_ends_of_each_edge_in_turn():
    points, faces = grid(3, bent)
    topology = build_topology(faces, 9)
    for number, (a, b) in enumerate(topology.edges):
        there, back = spokes(points, topology)[2 * number : 2 * number + 2]
        np.testing.assert_array_equal(there, points[b] - points[a])
        np.testing.assert_array_equal(back, points[a] - points[b])


def test_the_mean_over_a_vertex_is_that_of_its_spokes_and_0_where_there_are_none():
    points, faces = bow_tie()
    topology = build_topology(faces, len(points) + 1)
    values = np.arange(2.0 * len(topology.edges))[:, None] ** 2
    ends = topology.edges.reshape(-1)
    expected = [[values[ends == v].mean()] for v in range(len(points))] + [[0.0]]
    np.testing.assert_allclose(neighbour_mean(values, topology), expected, rtol=1e-15)


def test_what_is_divided_by_nothing_is_nothing():
    made = divided(np.array([[2.0, 4.0], [2.0, 4.0]]), np.array([[4.0], [0.0]]))
    assert made.tolist() == [[0.5, 1.0], [0.0, 0.0]]
