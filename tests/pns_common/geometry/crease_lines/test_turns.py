"""How far edges turn: what is beyond an angle, wherever a mesh lies."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import EDGED_ANGLE
from pns_common.geometry.crease_lines.turns import edges_beyond, have_flat_sides
from pns_common.geometry.frames import face_normals
from tests.support.crease_lines import normals_of
from tests.support.meshes import rotation
from train.data.primitives import box, cylinder


def test_an_edge_is_beyond_an_angle_where_both_faces_have_a_normal():
    cube = box()
    topology = build_topology(cube.faces, 8)
    for degrees, count in ((89.9, 12), (90.1, 0)):
        cosine = np.cos(np.radians(degrees))
        assert len(edges_beyond(normals_of(cube), topology, topology.interior, cosine)) == count
    flat = face_normals(cube.vertices * [1, 1, 0], cube.faces)
    assert len(edges_beyond(flat, topology, topology.interior, 2.0)) < 18


@pytest.mark.parametrize(
    ("first", "second", "are_flat"), [(39, 39, True), (41, 39, False), (39, 41, False)]
)
def test_sides_are_flat_where_one_in_each_face_turns_less_than_half_as_much(
    first, second, are_flat
):
    """Of an edge that turns by 80 degrees; the other sides of its faces turn by 100."""
    faces = np.array([[0, 1, 2], [1, 0, 3], [2, 1, 4], [0, 2, 5], [3, 0, 6], [1, 3, 7]])
    mesh = build_topology(faces, 8)
    turned = np.radians([0, 80, -first, 100, 80 + second, -20])
    normals = np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
    edge = np.flatnonzero((mesh.edges == [0, 1]).all(axis=1))
    assert have_flat_sides(normals, mesh, edge).tolist() == [are_flat]


@pytest.mark.parametrize("sides", [17, 18])
def test_no_tube_s_walls_turn_by_the_angle_itself_however_they_lie(sides):
    """Else rounding would decide of how many turns a mesh has, and whether it is edged."""
    tube, rng = cylinder(sides), np.random.default_rng(0)
    topology = build_topology(tube.faces, len(tube.vertices))
    cosine = np.cos(np.radians(EDGED_ANGLE))
    walls = sides if sides < 18 else 0
    for _ in range(20):
        normals = face_normals(tube.vertices @ rotation(rng).T, tube.faces)
        bent = edges_beyond(normals, topology, topology.interior, cosine)
        assert len(bent) == 2 * sides + walls
