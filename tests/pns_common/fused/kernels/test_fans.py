"""Fans are walked from one corner of each vertex, both ways where they are open."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.creases import crease_classes
from pns_common.fused.kernels.fans import count_corners, mark_multi_fan
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bow_tie, icosphere, one_way_pair
from tests.support.stars import star

POINTS, FACES = icosphere(0)
# Two closed surfaces that share their first vertex.
KISSING = (np.concatenate([POINTS, POINTS]), np.concatenate([FACES, FACES + 12 * (FACES > 0)]))
EXPECTED = {
    "closed": (POINTS, FACES, []),
    "open": (*star(4, closed=False), []),
    "bow-tie": (*bow_tie(), [0]),
    "one-way pair": (*one_way_pair(), [0, 1]),
    "kissing": (*KISSING, [0]),
}


def told(way, points, faces, creases=None):
    mesh = edges_built(Mesh(points, faces))
    kinds, count = mesh.edge_class, len(points)
    if creases is not None:
        kinds = crease_classes(mesh.edges, kinds, count, creases)
    corner, corners = (np.zeros(count, dtype=np.int32) for _ in range(2))
    for begin, end in ((0, count // 2), (count // 2, count)):
        WAYS[way](count_corners)(mesh.faces, mesh.face_reach, begin, end, corner, corners)
    np.testing.assert_array_equal(corners, np.bincount(faces.reshape(-1), minlength=count))
    used = np.flatnonzero(corners)
    np.testing.assert_array_equal(faces.reshape(-1)[corner[used]], used)
    multi_fan = np.ones(count, dtype=bool)
    WAYS[way](mark_multi_fan)(
        *(mesh.face_edges, mesh.half_edges, kinds, corner, corners, mesh.sharp),
        *(int(mesh.plain), 0, count, multi_fan),
    )
    return np.flatnonzero(multi_fan).tolist()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("shape", EXPECTED)
def test_vertices_with_several_fans(shape, way):
    points, faces, expected = EXPECTED[shape]
    assert told(way, points, faces) == expected


@pytest.mark.parametrize("way", WAYS)
def test_a_crease_parts_no_fan(way):
    points, faces = star(5, closed=True)
    assert told(way, points, faces, np.array([[0, 1], [0, 3]])) == []
