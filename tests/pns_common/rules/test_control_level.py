"""What a level knows of itself: its budget at a vertex, its normals, and lengths measured once."""

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.formula.prior import normal_pushes
from pns_common.rules.control_level import ControlLevel, control_level
from tests.support.meshes import TETRAHEDRON, bumpy_sphere

POINTS = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]])
TOPOLOGY = build_topology(TETRAHEDRON, 4)


def test_a_budget_is_shared_out_by_the_unit_of_the_whole_or_of_each_vertex():
    assert control_level(POINTS, TOPOLOGY, 4.0).budget_per_length(np.array([0, 3]), 0.5) == 1 / 8
    lengths = np.array([1.0, 2.0, 4.0, 8.0])
    of_parts = ControlLevel(POINTS, TOPOLOGY, np.zeros((4, 3)), lengths)
    assert of_parts.budget_per_length(np.array([3, 1]), 2.0).tolist() == [1 / 4, 1.0]


def test_a_level_of_points_alone_has_the_normals_of_its_faces():
    level = control_level(POINTS, TOPOLOGY, depth=2)
    outside = [[0, 0, -1], [0, -1, 0], np.full(3, 3**-0.5), [-1, 0, 0]]
    np.testing.assert_allclose(level.normals, outside, atol=1e-15)
    assert (level.depth, level.reference_length) == (2, 1.0)


def test_both_rules_are_given_the_same_rings_pushes_and_lengths():
    points, faces = bumpy_sphere(0, subdivisions=0)
    level = control_level(points, build_topology(faces, len(points)))
    assert level.rings is level.rings
    assert level.pushes is level.pushes
    np.testing.assert_array_equal(level.pushes, normal_pushes(level.rings))
    assert level.network_lengths(0.5) is level.network_lengths(0.5)
    assert (level.network_lengths(0.5).at_edges < level.network_lengths(None).at_edges).any()
