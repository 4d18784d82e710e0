"""Smooth fans of corners: one a vertex, but where sharp edges or bow-ties part them."""

import numpy as np

from pns_common.base.distinct import number_by_first_appearance
from pns_common.connectivity.smooth_fans import smooth_fans
from tests.support.meshes import bow_tie, bumpy_sphere, icosphere
from tests.support.stars import star


def fans_at(vertex, points, faces, creases=None):
    """How many fans there are at a vertex, no two vertices sharing one."""
    fans = smooth_fans(faces, len(points), creases)
    assert len({(fan, v) for fan, v in zip(fans.flat, faces.flat, strict=True)}) == fans.max() + 1
    return len(np.unique(fans[faces == vertex]))


def test_fans_of_a_smooth_surface_are_its_vertices_as_they_first_appear():
    points, faces = bumpy_sphere(0, subdivisions=2)
    expected = number_by_first_appearance(faces.reshape(-1))[0].reshape(-1, 3)
    np.testing.assert_array_equal(smooth_fans(faces, len(points), None), expected)


def test_a_vertex_has_as_many_fans_as_creases_part_it_into():
    points, faces = star(5, closed=True)
    counts = [fans_at(0, points, faces, np.array([[0, 1], [3, 0], [0, 4]])[:n]) for n in range(4)]
    # One crease ends there: the faces still follow one another the other way round.
    assert counts == [1, 1, 2, 3]


def test_a_bow_tie_has_two_fans_where_it_is_pinched():
    assert fans_at(0, *bow_tie()) == 2


def test_creases_along_all_edges_leave_each_corner_alone():
    points, faces = icosphere(0)
    edges = np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]])
    fans = smooth_fans(faces, len(points), edges)
    np.testing.assert_array_equal(fans, np.arange(faces.size).reshape(-1, 3))
