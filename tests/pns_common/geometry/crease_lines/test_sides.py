"""What lies between two sides of a part, and which single triangles are sides."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines.sides import are_flat, between_sides
from tests.support.crease_lines import WEDGE, lines
from tests.support.meshes import rotation


@pytest.mark.parametrize(
    ("first", "second", "are_flat"), [(39, 39, True), (41, 39, False), (39, 41, False)]
)
def test_an_edge_lies_between_sides_where_one_more_in_each_face_turns_less_than_half_as_much(
    first, second, are_flat
):
    """Of an edge that turns by 80 degrees; the other sides of its faces turn by 100."""
    faces = np.array([[0, 1, 2], [1, 0, 3], [2, 1, 4], [0, 2, 5], [3, 0, 6], [1, 3, 7]])
    mesh = build_topology(faces, 8)
    turned = np.radians([0, 80, -first, 100, 80 + second, -20])
    normals = np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
    edge = np.flatnonzero((mesh.edges == [0, 1]).all(axis=1))
    assert between_sides(normals, mesh, edge).tolist() == [are_flat]


@pytest.mark.parametrize("turn", [60, 70, 90, 100, 180])
def test_a_face_whose_others_turn_by_just_half_as_much_is_not_flat_however_it_is_turned(turn):
    mesh = build_topology(np.array([[0, 1, 2], [1, 0, 3], [2, 1, 4], [0, 2, 5]]), 6)
    turned = np.radians([0, turn, -turn / 2, turn / 2])
    normals = np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
    face, edge = np.array([0]), np.flatnonzero((mesh.edges == [0, 1]).all(axis=1))
    for seed in range(40):
        around = normals @ rotation(np.random.default_rng(seed)).T
        assert not are_flat(around, mesh, face, edge).any()


def test_a_single_triangle_is_a_side_where_all_around_it_are():
    """A wedge's ends are, and what it stands on; no side of a pyramid is, nor of an octahedron."""
    assert len(lines(WEDGE)) == 9
    assert lines(pyramid()) == set()


def pyramid():
    """Four triangles on a square, which is cut in two."""
    points = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1]]
    return Mesh(points, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]])
