"""Loop's masks by kernels, against sums over neighbours."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.fused.kernels.masks import (
    add_displacement,
    blend_vertices,
    largest_coordinate,
    opposite,
    place_edges,
    sum_along_curves,
    sum_rings,
)
from pns_common.masks.stencils import loop_beta
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bent, grid

POINTS, FACES = grid(4, bent)
MESH, TOPOLOGY = edges_built(Mesh(POINTS, FACES)), build_topology(FACES, 16)
PAIRS = TOPOLOGY.edges.tolist()


def neighbours(v, among):
    return [b if a == v else a for a, b in among if v in (a, b)]


def test_the_vertex_opposite_a_half_edge_is_the_third_of_its_face():
    assert [opposite(FACES, h) for h in range(6)] == [
        *FACES[0, [2, 0, 1]],
        *FACES[1, [2, 0, 1]],
    ]


@pytest.mark.parametrize("way", WAYS)
def test_edge_vertices(way):
    placed = np.empty((len(PAIRS), 3))
    edges = MESH.edges, MESH.half_edges, MESH.edge_class
    WAYS[way](place_edges)(POINTS, MESH.faces, *edges, 0, len(PAIRS), placed)
    for e, (a, b) in enumerate(PAIRS):
        beside = [v for face in FACES if {a, b} <= set(face) for v in set(face) - {a, b}]
        expected = (POINTS[a] + POINTS[b]) / 2
        if len(beside) == 2:
            expected = 3 / 8 * (POINTS[a] + POINTS[b]) + 1 / 8 * POINTS[beside].sum(axis=0)
        np.testing.assert_allclose(placed[e], expected, atol=1e-15)


@pytest.mark.parametrize("way", WAYS)
def test_old_vertices(way):
    sums, valence = np.zeros((16, 3)), np.zeros(16, dtype=np.int32)
    for begin, end in ((0, 5), (5, 16)):
        WAYS[way](sum_rings)(POINTS, MESH.edges, MESH.edge_reach, begin, end, sums, valence)
    rings = [neighbours(v, PAIRS) for v in range(16)]
    assert valence.tolist() == list(map(len, rings))
    np.testing.assert_allclose(sums, [POINTS[ring].sum(axis=0) for ring in rings], atol=1e-14)
    along = POINTS, MESH.edges, MESH.sharp_edges, MESH.sharp
    for begin, end in ((0, 5), (5, 16)):
        WAYS[way](sum_along_curves)(*along, begin, end, sums)
    beta = loop_beta(np.arange(7))
    WAYS[way](blend_vertices)(POINTS, valence, MESH.sharp, beta, 0, 16, sums)
    rim = [pair for pair, kind in zip(PAIRS, TOPOLOGY.edge_class, strict=True) if kind]
    for v in range(16):
        curve, k = neighbours(v, rim), len(rings[v])
        expected = 3 / 4 * POINTS[v] + POINTS[curve].sum(axis=0) / 8
        if not curve:
            b = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
            expected = (1 - k * b) * POINTS[v] + b * POINTS[rings[v]].sum(axis=0)
        np.testing.assert_allclose(sums[v], expected, atol=1e-14)


@pytest.mark.parametrize("way", WAYS)
def test_a_vertex_on_three_sharp_edges_stays(way):
    sharp, beta = np.array([3], dtype=np.int32), loop_beta(np.arange(7))
    sums, valence = np.array([[9.0, 9, 9]]), np.array([6], dtype=np.int32)
    WAYS[way](blend_vertices)(POINTS[:1], valence, sharp, beta, 0, 1, sums)
    np.testing.assert_array_equal(sums, POINTS[:1])
    assert (TOPOLOGY.edge_class == EdgeClass.BOUNDARY).sum() == 12


@pytest.mark.parametrize("way", WAYS)
def test_the_largest_coordinate_is_told_with_its_faults(way):
    largest = WAYS[way](largest_coordinate)
    points = np.array([[1.0, -5, 2], [3, 4, 0], [0, np.inf, 0], [0, np.nan, 1]])
    assert largest(points, 0, 2) == 5
    assert largest(points, 1, 2) == 4
    assert largest(points, 0, 3) == np.inf
    assert np.isnan(largest(points, 0, 4))
    assert largest(points, 0, 0) == 0


@pytest.mark.parametrize("way", WAYS)
def test_what_is_added_leaves_loops_rows_alone_and_is_measured_with_them(way):
    points = np.array([[-0.0, -9, 0], [1, 2, 3], [-0.0, 4, 0], [7, 7, 7]])
    delta = np.array([[0.0, 0, 0], [0, 0, 0], [0, -20, 1], [1, 1, 1]])
    longest = np.full(1, 99.0)
    assert WAYS[way](add_displacement)(delta, 1, 0, 3, points, longest) == 16
    assert longest[0] == 401
    np.testing.assert_array_equal(points, [[0, -9, 0], [1, 2, 3], [0, -16, 1], [7, 7, 7]])
    assert np.signbit(points[0, 0])
    assert not np.signbit(points[2, 0])
    assert WAYS[way](add_displacement)(delta, 4, 3, 4, points, longest) == 7
    assert longest[0] == 0
