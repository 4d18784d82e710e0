"""A mesh is shaded smooth where more than half of the edges that turn are smooth."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.geometry.shaded_smooth import shaded_smooth
from train.data.primitives import box, icosphere


def edge_faces(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    return topology.edge_faces[topology.interior]


@pytest.mark.parametrize(("hard", "is_smooth"), [(0, True), (14, True), (15, False), (30, False)])
def test_more_than_half_of_the_edges_have_to_be_smooth(hard, is_smooth):
    mesh = icosphere(0)
    smooth = np.arange(30) >= hard
    assert shaded_smooth(mesh.vertices, mesh.faces, edge_faces(mesh), smooth) == [is_smooth]


def test_diagonals_of_flat_sides_say_nothing():
    mesh = box()
    faces = edge_faces(mesh)
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    diagonal = (np.cross(*normals[faces].transpose(1, 0, 2)) == 0).all(axis=1)
    assert diagonal.sum() == 6
    assert shaded_smooth(mesh.vertices, mesh.faces, faces, diagonal) == [False]
    one_more = diagonal.copy()
    one_more[np.flatnonzero(~diagonal)[:7]] = True
    assert shaded_smooth(mesh.vertices, mesh.faces, faces, one_more) == [True]


def test_each_part_is_asked_for_itself_and_one_without_edges_is_not():
    mesh = icosphere(0)
    part = np.repeat([0, 2], 15)
    smooth = part == 2
    asked = mesh.vertices, mesh.faces, edge_faces(mesh), smooth, part, 3
    assert shaded_smooth(*asked).tolist() == [False, False, True]


def test_faces_without_area_turn_from_none():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 1]])
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    assert shaded_smooth(points, faces, np.array([[0, 1]]), np.array([True])) == [False]


@pytest.mark.parametrize(("degrees", "turns"), [(0.9, False), (1.1, True)])
def test_edges_that_turn_by_less_than_a_degree_say_nothing(degrees, turns):
    half = np.radians(degrees) / 2
    side = [np.cos(half), np.sin(half)]
    points = np.array([[0.0, 0, 0], [0, 1, 0], [side[0], 0, side[1]], [-side[0], 0, side[1]]])
    faces = np.array([[0, 1, 3], [1, 0, 2]])
    assert shaded_smooth(points, faces, np.array([[0, 1]]), np.array([True])) == [turns]
