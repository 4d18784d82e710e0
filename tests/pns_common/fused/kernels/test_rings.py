"""Kernels around vertices: small numbers by hand, and ranges that leave the others alone."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.fused.kernels.rings import (
    HEIGHT,
    face_bends,
    mean_normals,
    mean_spokes,
    measure_faces,
    prior_pushes,
    umbrella_heights,
)
from tests.support.kernels import WAYS, edges_built

# A tent over a square: four faces, the tip at 1.
POINTS = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1]])
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
MESH = edges_built(Mesh(POINTS, FACES))
THIRD = 3**-0.5


@pytest.mark.parametrize("way", WAYS)
def test_areas_are_measured_only_where_there_is_room_for_them(way):
    normals, areas = np.empty((4, 3)), np.empty((0, 4))
    WAYS[way](measure_faces)(POINTS, MESH.faces, 0, 4, normals, areas)
    np.testing.assert_array_equal(normals, measured(way)[0])


def measured(way):
    normals, areas = np.empty((4, 3)), np.empty((4, 4))
    WAYS[way](measure_faces)(POINTS, MESH.faces, 0, 4, normals, areas)
    return normals, areas


def spokes():
    """Sine and x at each edge's normals, and its length."""
    inner = (MESH.edges == 4).any(axis=1)
    return inner * np.sqrt(8) / 3, inner * 2 / 3, np.full(8, np.sqrt(2))


@pytest.mark.parametrize("way", WAYS)
def test_faces_of_a_tent(way):
    normals, areas = measured(way)
    np.testing.assert_allclose(areas[:, 3], np.sqrt(3))
    np.testing.assert_allclose(
        normals, THIRD * np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]])
    )


@pytest.mark.parametrize("way", WAYS)
def test_the_tip_of_a_tent(way):
    _, areas = measured(way)
    fields, means = np.zeros((5, 4)), np.zeros((5, 15))
    valence = np.zeros(5, dtype=np.int32)
    edges = MESH.edges, MESH.edge_reach
    WAYS[way](mean_normals)(MESH.faces, MESH.face_reach, areas, 4, 5, fields)
    np.testing.assert_allclose(fields[4, :3], [0, 0, THIRD], atol=1e-16)
    assert not fields[:4].any()
    WAYS[way](mean_spokes)(POINTS, *edges, *spokes(), 4, 5, means, valence)
    assert valence.tolist() == [0, 0, 0, 0, 4]
    np.testing.assert_allclose(means[4, :5], [0, 0, -1, 2, 2 / 3], atol=1e-15)
    assert not means[:4].any()
    WAYS[way](umbrella_heights)(means, MESH.sharp, 0, 5, fields)
    assert fields[4, HEIGHT] == pytest.approx(-THIRD / np.sqrt(2))
    assert not fields[:4, HEIGHT].any()
    pushes, smooth = np.full((5, 3), 9.0), np.array([0, 0, 0, 0, 1], dtype=np.int32)
    weight = np.array([0, 0, 0, 0, 0.5])
    WAYS[way](prior_pushes)(means, fields, valence, smooth, weight, 0, 5, pushes)
    np.testing.assert_allclose(pushes, [[0] * 3] * 4 + [[0, 0, 0.5]], atol=1e-15)


@pytest.mark.parametrize("way", WAYS)
def test_bends_count_while_they_are_gentle(way):
    jumps, bends = spokes()[1], np.empty(4)
    # x is 2/3 at two edges of each face: whole below `gentle`, nothing above `sharp`.
    for gentle, sharp, share in ((0.7, 0.9, 1.0), (1 / 3, 1.0, 0.5), (0.3, 0.6, 0.0)):
        WAYS[way](face_bends)(MESH.face_edges, jumps, gentle, sharp, 0, 4, bends)
        np.testing.assert_allclose(bends, share * 4 / 9)
