"""Held edges: faces within a plane side, beside its lines, do not come to lie on others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, crease_lines, load_model, pns, refine
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines.held_edges import with_held_edges
from pns_common.geometry.frames import face_normals
from tests.support.crease_lines import WITH_GENTLE, held, lines, normals_of
from tests.support.meshes import prism, rotation
from train.data.parts import closed_grid_faces
from train.data.primitives import box

GENERAL = pns(load_model())
HIGH = 0.1


def frame(sides, width, stretch=1.0):
    """A picture frame: a rectangle turned round a polygon's rim, its mitres at the corners."""
    around = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([stretch * np.cos(around), np.sin(around)], axis=1)
    outline = ((1, 0), (1, HIGH), (1 - width, HIGH), (1 - width, 0))
    rings = [np.c_[reach * rim, np.full(sides, height)] for reach, height in outline]
    return Mesh(np.concatenate(rings), closed_grid_faces(4, sides)[:, ::-1])


def box_on_which(points, upper):
    """A box whose upper side, of corners 4 … 7, is cut into other triangles, with points in it."""
    corners = [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
        [0, 1, 1],
    ]
    quads = [[0, 3, 2, 1], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    faces = [[a, b, c] for quad in quads for a, b, c in (quad[:3], [quad[0], *quad[2:]])]
    return Mesh([*corners, *([x, y, 1] for x, y in points)], faces + upper)


def mitres(sides):
    """Of a frame the edges from its outer to its inner rim, above and below."""
    k = np.arange(sides)
    return {*zip(k + sides, k + 2 * sides, strict=True), *zip(k, k + 3 * sides, strict=True)}


@pytest.mark.parametrize(("sides", "width"), [(4, 0.02), (4, 0.3), (4, 0.7), (5, 0.3), (6, 0.1)])
@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_a_frame_stays_one(sides, width, stretch):
    assert_flat_faces_lie_on_none(frame(sides, width, stretch))


@given(st.floats(0.03, 0.97), st.floats(0.03, 0.97))
def test_so_does_a_side_that_is_cut_into_uneven_triangles(x, y):
    mesh = box_on_which([(x, y)], [[4, 5, 8], [5, 6, 8], [6, 7, 8], [7, 4, 8]])
    assert_flat_faces_lie_on_none(mesh)
    assert held(mesh) == {(corner, 8) for corner in (4, 5, 6, 7)}


def test_a_point_that_does_not_stay_has_no_held_edges():
    """Two would make a curve of it, on which it moves, and one keeps its middle while it moves."""
    upper = [[4, 8, 7], [4, 9, 8], [8, 9, 7], [4, 5, 9], [5, 6, 9], [6, 7, 9]]
    mesh = box_on_which([(0.1, 0.5), (0.6, 0.5)], upper)
    assert held(mesh) == {(corner, 9) for corner in (4, 5, 6, 7)}


def test_a_point_of_a_straight_line_stays_too():
    """Beside it a side is as uneven: Loop would take it a fifth of the line along."""
    mesh = prism([[0, 1], [0, 0], [0.1, 0], [2, 0], [2, 1]])
    assert_flat_faces_lie_on_none(mesh)
    np.testing.assert_array_equal(refine(mesh, GENERAL, 2).mesh.vertices[2], mesh.vertices[2])


def assert_flat_faces_lie_on_none(mesh):
    """Before the lines end the children of level faces lie in their sides, all one way up."""
    above = face_normals(mesh.vertices, mesh.faces)
    for levels in (1, 2):
        refined = refine(mesh, GENERAL, levels).mesh
        normals = face_normals(refined.vertices, refined.faces)
        of_level = np.repeat(np.abs(above[:, 2]) > 0.99, 4**levels)
        turned = (normals * np.repeat(above, 4**levels, axis=0)).sum(axis=1)
        assert (turned[of_level] > 0.99).all()


@pytest.mark.parametrize("sides", [4, 5, 6])
def test_mitres_are_held_with_the_lines(sides):
    mesh = frame(sides, 0.2)
    # Four rims, and as many edges down the walls, inside and out.
    assert len(lines(mesh, WITH_GENTLE)) == 6 * sides
    assert mitres(sides) <= held(mesh, WITH_GENTLE)


def test_where_the_rims_are_round_nothing_is_held():
    assert not held(frame(24, 0.2), WITH_GENTLE)


@pytest.mark.parametrize(("sides", "are_straight"), [(712, False), (720, True)])
def test_where_they_are_cut_into_half_degrees_all_is_held_however_it_is_turned(sides, are_straight):
    mesh = frame(sides, 0.2)
    turned = Mesh(mesh.vertices @ rotation(np.random.default_rng(0)).T, mesh.faces)
    assert held(mesh) == held(turned)
    assert mitres(sides) & held(mesh) == (mitres(sides) if are_straight else set())


def test_where_loop_stays_at_the_middle_there_are_none():
    assert len(crease_lines(box(4, 2, 0.1))) == 12


def test_a_side_that_is_not_plane_has_none():
    mesh = frame(4, 0.2)
    points = mesh.vertices.copy()
    # The upper inner rim lower: the four upper sides slope, and turn at their mitres.
    points[8:12, 2] -= 0.05
    assert not {(4 + k, 8 + k) for k in range(4)} & held(Mesh(points, mesh.faces))


@pytest.mark.parametrize(
    "others", [[[0, 4, 5], [1, 6, 7]], [[0, 4, 5], [0, 4, 8], [1, 6, 7], [1, 6, 9]]]
)
def test_in_a_plane_there_are_none_though_other_edges_meet_in_corners(others):
    """At both ends of two faces' common edge others touch in a vertex, or lie on each other."""
    rim = [[0, 0], [1, 0], [6, 1], [5, -1], [-1, 0.3], [-1, -0.3], [2, -0.02], [2, 0.02]]
    points = np.column_stack([[*rim, [-2, -0.3], [2, 0.03]], np.zeros(10)])
    mesh = Mesh(points, [[0, 1, 2], [1, 0, 3], *others])
    assert (face_normals(points, mesh.faces)[:, 2] == 1).all()
    assert len(crease_lines(mesh)) == 0
    assert "crease" not in refine(mesh, GENERAL).report["levels"][0]["edges"]


def test_creases_that_are_named_have_them_too():
    mesh = frame(4, 0.2)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    creased = with_creases(topology, np.array(list(lines(mesh))))
    rows = with_held_edges(mesh.vertices, normals_of(mesh), creased, np.zeros(0, dtype=np.int64))
    assert {tuple(pair) for pair in topology.edges[rows].tolist()} == held(mesh)


@pytest.mark.parametrize("seed", range(3))
def test_they_go_with_the_mesh(seed):
    rng, mesh = np.random.default_rng(seed), frame(4, 0.2)
    order = rng.permutation(16)
    points, faces = np.empty((16, 3)), order[mesh.faces][rng.permutation(32)]
    points[order] = 7 * mesh.vertices @ rotation(rng).T + [1, 2, 3]
    expected = {tuple(sorted(order[list(pair)])) for pair in held(mesh)}
    assert held(Mesh(points, faces)) == expected
    mirrored = Mesh(points * [-1, 1, 1], faces[:, ::-1])
    assert held(mirrored) == expected
