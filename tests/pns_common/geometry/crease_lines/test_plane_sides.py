"""Which sides tell of themselves that they are plane."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines.plane_sides import beside_planes
from tests.support.crease_lines import WITH_GENTLE, lines, normals_of, pleat, tube


@pytest.mark.parametrize("sides", [6, 8, 12, 16])
def test_walls_that_were_cut_finely_have_edges_where_they_meet(sides):
    assert len(lines(tube(sides, across=3), WITH_GENTLE)) == 4 * sides


@pytest.mark.parametrize("sides", [6, 8, 12, 16])
def test_a_tube_whose_walls_are_rows_of_quads_is_round(sides):
    assert lines(tube(sides, across=1), WITH_GENTLE) == set()


def test_a_gentle_fold_is_a_line_beyond_the_gentle_angle_alone():
    assert len(lines(pleat(30), WITH_GENTLE)) == 4
    assert lines(pleat(20), WITH_GENTLE) == set()
    # Nobody said so of walls where one angle alone is asked for.
    assert lines(pleat(30)) == set()


def test_walls_that_are_not_plane_tell_nothing():
    mesh = tube(8, across=3)
    noise = 0.01 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    assert lines(Mesh(mesh.vertices + noise, mesh.faces), WITH_GENTLE) == set()


def test_an_edge_lies_beside_a_plane_side_where_a_third_corner_is_inside_of_one():
    """One of two columns beside the fold: the other's far vertices are on the rim."""
    mesh = pleat(30)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    fold = np.flatnonzero((mesh.vertices[topology.edges, 1] == 0).all(axis=1))
    assert beside_planes(normals_of(mesh), topology, fold).all()
    narrow = pleat(30, cells=2)
    topology = build_topology(narrow.faces, len(narrow.vertices))
    fold = np.flatnonzero((narrow.vertices[topology.edges, 1] == 0).all(axis=1))
    assert not beside_planes(normals_of(narrow), topology, fold).any()
