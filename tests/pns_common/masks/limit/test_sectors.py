"""Sectors of a vertex: one closed, or one between every two sharp edges, corners in their order."""

import numpy as np
import pytest
from hypothesis import given

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.masks.limit.sectors import sectors
from tests.support.meshes import bow_tie, manifolds
from tests.support.stars import star


def around_centre(topology):
    """The sectors of vertex 0: the faces of each in their order, and whether it is closed."""
    around = sectors(topology)
    made = []
    for sector in np.flatnonzero(around.vertex == 0):
        corners = np.flatnonzero(around.of_corner == sector)
        ordered = corners[np.argsort(around.rank[corners])]
        assert around.rank[ordered].tolist() == list(range(around.size[sector]))
        lasts = around.last[ordered].tolist()
        closed = bool(around.closed[sector])
        assert lasts == [False] * (len(lasts) - 1) + [not closed]
        made.append(((ordered // 3).tolist(), closed))
    return made


def test_a_closed_fan_is_one_closed_sector_and_an_open_one_an_open_sector():
    closed, open_ = (build_topology(star(5, kind)[1], 6 + (not kind)) for kind in (True, False))
    assert around_centre(closed) == [([0, 1, 2, 3, 4], True)]
    assert around_centre(open_) == [([0, 1, 2, 3, 4], False)]


@pytest.mark.parametrize(
    ("creases", "expected"),
    [
        ([1], [([0, 1, 2, 3, 4, 5], False)]),
        ([1, 4], [([0, 1, 2], False), ([3, 4, 5], False)]),
        ([2, 3, 6], [([1], False), ([2, 3, 4], False), ([5, 0], False)]),
    ],
)
def test_creases_part_the_faces_around_a_vertex(creases, expected):
    topology = build_topology(star(6, closed=True)[1], 7)
    topology = with_creases(topology, np.array([[0, j] for j in creases]))
    assert sorted(around_centre(topology)) == sorted(expected)


def test_two_fans_at_one_vertex_are_two_sectors():
    around = sectors(build_topology(bow_tie()[1], 5))
    assert np.bincount(around.vertex).tolist() == [2, 1, 1, 1, 1]
    assert not around.closed.any()


@given(manifolds())
def test_every_corner_is_in_one_sector_of_its_own_vertex(mesh):
    around = sectors(build_topology(mesh.faces, len(mesh.vertices)))
    np.testing.assert_array_equal(around.vertex[around.of_corner], mesh.faces.reshape(-1))
    np.testing.assert_array_equal(np.bincount(around.of_corner), around.size)
