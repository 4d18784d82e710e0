"""The paper's rules under networks that say one thing: equation 1 and its like, by hand."""

from math import tanh

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import paper_features
from pns_common.features.orientation import FIRST_FACE
from pns_common.features.ring_features import RING_10
from pns_common.formula.correction import curvature_gate
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.rules.control_level import control_level
from pns_common.rules.learned import LearnedEdgeRule, LearnedVertexRule
from tests.support.meshes import bumpy_sphere, grid
from tests.support.plain_operator import PlainMesh, shortened

POINTS, FACES = bumpy_sphere(6, subdivisions=0, bump=0.2)
TOPOLOGY, PLAIN = build_topology(FACES, len(POINTS)), PlainMesh(POINTS, FACES)
BUDGET, R, SHARPNESS = 0.3, 0.8, 2.0


def along(vector):
    return lambda rows: np.tile(vector, (len(rows), 1))


def edge_rule(vector):
    gate = curvature_gate(SHARPNESS)
    return LearnedEdgeRule(EdgeOperator(paper_features, FIRST_FACE, along(vector), gate), BUDGET)


def vertex_rule(vector):
    return LearnedVertexRule(VertexOperator(RING_10, along(vector), SHARPNESS), BUDGET)


@pytest.mark.parametrize("normal", [-0.6, 5.0])
def test_an_edge_vertex_moves_along_its_normal_by_no_more_than_the_bound(normal):
    placed = edge_rule([0.0, normal, 0.0])(control_level(POINTS, TOPOLOGY, R))
    for (a, b), position in zip(TOPOLOGY.edges.tolist(), placed.positions, strict=True):
        size = BUDGET / R * PLAIN.length(a, b, None) ** 2 * tanh(SHARPNESS * PLAIN.jump(a, b) ** 2)
        delta = size * np.clip(normal, -1, 1) * PLAIN.frame(a, b)[1]
        np.testing.assert_allclose(position, PLAIN.loop_edge(a, b, POINTS) + delta, atol=1e-14)


@pytest.mark.parametrize("weights", [[0.5, 0.0, 0.0], [0.0, 0.0, -9.0], [0.6, 0.6, 0.2]])
def test_a_vertex_moves_along_its_rings_vectors(weights):
    placed = vertex_rule(weights)(control_level(POINTS, TOPOLOGY, R))
    for v, position in enumerate(placed.positions):
        combined = shortened(np.array(weights), 1) @ np.array(PLAIN.ring_vectors(v))
        size = BUDGET / R * PLAIN.spoke_length(v) ** 2 * tanh(SHARPNESS * PLAIN.mean_jump[v])
        expected = PLAIN.loop_vertex(v, POINTS) + size * shortened(combined, 1)
        np.testing.assert_allclose(position, expected, atol=1e-14)
    assert placed.corrected.all()


def test_boundaries_are_loops():
    points, faces = grid(4, lambda x, y: x * y)
    level = control_level(points, build_topology(faces, 16), R)
    edges, vertices = (rule([0.0, 1.0, 0.0])(level) for rule in (edge_rule, vertex_rule))
    assert np.flatnonzero(vertices.corrected).tolist() == [5, 6, 9, 10]
    assert not vertices.displacement[~vertices.corrected].any()
    at_rim = level.topology.edge_class != 0
    np.testing.assert_array_equal(
        edges.positions[at_rim], points[level.topology.edges[at_rim]].mean(axis=1)
    )


def test_without_a_unit_of_length_both_are_loops():
    level = control_level(POINTS, TOPOLOGY, 0.0)
    for rule in (edge_rule, vertex_rule):
        assert rule([0.0, 1.0, 0.0])(level).displacement is None
