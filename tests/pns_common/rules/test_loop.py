"""Loop's rules by hand on a tetrahedron, and the same in blocks."""

import numpy as np

from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.rules.control_level import ControlLevel, control_level
from pns_common.rules.loop import loop_edge_rule, loop_vertex_rule
from tests.support.meshes import TETRAHEDRON, bent, grid

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])


def test_a_tetrahedron_by_hand():
    """Valence 3: β = (5/8 − (3/8 − 1/8)²) / 3 = 3/16. Every edge has the other two opposite."""
    level = control_level(POINTS, build_topology(TETRAHEDRON, 4))
    total = POINTS.sum(axis=0)
    vertices, edges = loop_vertex_rule(level), loop_edge_rule(level)
    np.testing.assert_allclose(vertices.loop, 7 / 16 * POINTS + 3 / 16 * (total - POINTS))
    ends = POINTS[level.topology.edges].sum(axis=1)
    np.testing.assert_allclose(edges.loop, 3 / 8 * ends + 1 / 8 * (total - ends))
    for placed in (vertices, edges):
        assert placed.displacement is None
        assert not any(part.any() for part in (placed.ratio, placed.gate, placed.degenerate))


def test_blocks_change_nothing():
    points, faces = grid(5, bent)
    whole = control_level(points, build_topology(faces, len(points)))
    divided = ControlLevel(points, whole.topology, whole.normals, 1.0, Blocks(2, rows=7))
    np.testing.assert_array_equal(loop_edge_rule(divided).loop, loop_edge_rule(whole).loop)
