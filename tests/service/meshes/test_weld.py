"""Welding by exact position, in the precision that it comes in."""

import numpy as np

from service.meshes.weld import weld


def test_vertices_are_numbered_by_first_appearance_over_corners():
    positions = np.array([[9, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [3, 0, 0]], dtype=np.float32)
    welded = weld(positions, np.array([[4, 1, 2], [2, 3, 4]]))
    np.testing.assert_array_equal(welded.faces, [[0, 1, 2], [2, 1, 0]])
    np.testing.assert_array_equal(welded.points[:, 0], [3, 1, 2])
    np.testing.assert_array_equal(welded.vertex_of, [-1, 1, 2, 1, 0])


def test_zeros_of_either_sign_are_one_position():
    positions = np.array([[0.0, 0, 0], [-0.0, 0, -0.0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
    assert weld(positions, np.array([[0, 2, 3], [1, 3, 2]])).vertex_of[1] == 0


def test_neighbouring_floats_stay_apart():
    positions = np.zeros((3, 3), dtype=np.float32)
    positions[1, 0] = np.float32(1)
    positions[2, 0] = np.nextafter(np.float32(1), np.float32(2))
    assert len(weld(positions, np.array([[0, 1, 2]])).points) == 3


def test_double_precision_is_welded_as_double():
    positions = np.array([[0, 0, 0], [1, 0, 0], [1 + 1e-12, 0, 0], [1, -0.0, 0]])
    welded = weld(positions, np.array([[0, 1, 2], [3, 2, 0]]))
    assert welded.vertex_of.tolist() == [0, 1, 2, 1]
    np.testing.assert_array_equal(welded.points, positions[:3])
