"""How far edges turn: what is beyond an angle, wherever a mesh lies."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import EDGED_ANGLE
from pns_common.geometry.crease_lines.turns import edges_beyond
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
