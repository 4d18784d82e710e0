"""What bends is marked, cut out and put back, by kernels and as the Python that they are."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import EdgeClass
from pns_common.fused.kernels.bent_part import (
    count_bent,
    mark_around,
    mark_bent_ends,
    mark_sides,
    number_rows,
    spread,
    take_edges,
    take_faces,
)
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import grid, three_pages

way = pytest.mark.parametrize("way", WAYS)


def roof():
    """Two planes that meet where x is 0: a 3 × 3 grid bent along its middle."""
    mesh = Mesh(*grid(3, lambda x, y: 0.5 * np.abs(x)))
    return mesh, edges_built(mesh)


@way
def test_an_edge_bends_where_its_faces_have_two_normals_or_one_has_none(way):
    mesh, edges = roof()
    x = mesh.vertices[:, 0]
    marked = np.zeros(9, dtype=bool)
    flat = np.where(x[mesh.faces].mean(axis=1)[:, None] < 0, [[1.0, 0, 0]], [[0, 1.0, 0]])
    args = edges.edges, edges.half_edges, edges.edge_class
    WAYS[way](mark_bent_ends)(flat, *args, 0, len(edges.edges), marked)
    assert marked.tolist() == (x == 0).tolist()
    assert WAYS[way](count_bent)(flat, *args[1:], 1) == 2
    flat[0] = 0
    WAYS[way](mark_bent_ends)(flat, *args, 0, len(edges.edges), marked)
    interior = edges.edge_class == EdgeClass.INTERIOR
    beside = interior & (edges.half_edges // 3 == 0).any(axis=1)
    assert marked[edges.edges[beside]].all()


@way
def test_normals_of_other_than_unit_length_to_the_last_bit_bend(way):
    """1 − n · n is then not 0, and the gate not shut."""
    _, edges = roof()
    almost = np.tile([[0.6, 0.8 + 1e-16, 0.0]], (8, 1))
    assert float(almost[0] @ almost[0]) != 1.0
    args = edges.half_edges, edges.edge_class
    interior = int((edges.edge_class == EdgeClass.INTERIOR).sum())
    assert WAYS[way](count_bent)(almost, *args, 1) == interior
    assert WAYS[way](count_bent)(np.tile([[0.0, 0.0, -1.0]], (8, 1)), *args, 1) == 0


@way
def test_faces_around_marked_vertices_with_their_corners_and_sides(way):
    mesh, edges = roof()
    marked = np.zeros(9, dtype=bool)
    marked[0] = True
    touched, corners = np.ones(8, dtype=bool), np.zeros(9, dtype=bool)
    found = WAYS[way](mark_around)(edges.faces, marked, 0, 8, touched, corners)
    expected = (mesh.faces == 0).any(axis=1)
    assert touched.tolist() == expected.tolist()
    assert found == expected.sum()
    assert np.flatnonzero(corners).tolist() == np.unique(mesh.faces[expected]).tolist()
    sides = np.zeros(len(edges.edges), dtype=bool)
    WAYS[way](mark_sides)(edges.face_edges, touched, 0, 8, sides)
    assert np.flatnonzero(sides).tolist() == np.unique(edges.face_edges[expected]).tolist()


@way
@pytest.mark.parametrize("flags", [[], [0], [1], [0, 1, 1, 0, 1, 0]])
def test_rows_are_numbered_in_their_order(way, flags):
    flags = np.array(flags, dtype=bool)
    numbers, rows = (np.full(len(flags), 9, dtype=np.int32) for _ in range(2))
    count = WAYS[way](number_rows)(flags, numbers, rows)
    assert rows[:count].tolist() == np.flatnonzero(flags).tolist()
    assert numbers.tolist() == (np.cumsum(flags) - flags).tolist()


@way
def test_a_cut_mesh_is_what_its_faces_alone_would_build_but_for_names(way):
    """Edges that lose a face are boundaries; of three pages two are left, and are called so."""
    for points, faces in (grid(5), three_pages()):
        whole = edges_built(Mesh(points, faces))
        for gone in range(len(faces)):
            kept = np.arange(len(faces)) != gone
            made = cut(way, whole, kept)
            alone = edges_built(Mesh(points, faces[kept]))
            old = np.unique(whole.edges[np.unique(whole.face_edges[kept])], axis=0)
            assert np.array_equal(np.unique(made["edges"], axis=0), np.unique(alone.edges, axis=0))
            assert np.array_equal(np.unique(alone.edges, axis=0), old)
            irregular = made["edge_class"] == EdgeClass.IRREGULAR
            for e in np.flatnonzero(~irregular):
                twin = np.flatnonzero((alone.edges == made["edges"][e]).all(axis=1))[0]
                assert made["edge_class"][e] == alone.edge_class[twin]
                assert made["half_edges"][e].tolist() == alone.half_edges[twin].tolist()
            assert (made["half_edges"][:, 0] >= 0).all()


def cut(way, whole, kept):
    """The edges of some faces, whose vertices keep their numbers here."""
    rows = np.flatnonzero(kept).astype(np.int32)
    face_numbers = (np.cumsum(kept) - kept).astype(np.int32)
    vertex_numbers = np.arange(whole.vertex_count, dtype=np.int32)
    named = np.unique(whole.face_edges[kept]).astype(np.int32)
    edge_numbers = np.zeros(len(whole.edges), dtype=np.int32)
    edge_numbers[named] = np.arange(len(named))
    sides = np.empty((len(rows), 3), dtype=np.int32)
    WAYS[way](take_faces)(whole.face_edges, edge_numbers, rows, 0, len(rows), sides)
    np.testing.assert_array_equal(named[sides], whole.face_edges[rows])
    made = {name: np.empty((len(named), 2), dtype=np.int32) for name in ("edges", "half_edges")}
    made["edge_class"] = np.empty(len(named), dtype=np.int8)
    args = whole.edges, whole.half_edges, whole.edge_class, named, vertex_numbers, face_numbers
    WAYS[way](take_edges)(*args, kept, 0, len(named), *made.values())
    return made


@way
def test_what_a_part_got_goes_to_its_rows_and_nothing_to_others(way):
    flags = np.array([0, 1, 1, 0, 1], dtype=bool)
    numbers = np.array([0, 0, 1, 2, 2], dtype=np.int32)
    part = np.arange(9.0).reshape(3, 3) + 1
    part[2] = 0
    of_rows = [np.array([k, k, k + 0.5]) for k in (1.0, 2.0, 3.0)]
    part_degenerate = np.array([1, 1, 1], dtype=bool)
    to = np.full((5, 3), np.nan), *(np.full(5, np.nan) for _ in range(3))
    degenerate, moved = np.ones(5, dtype=bool), np.ones(5, dtype=bool)
    args = flags, numbers, part, *of_rows, part_degenerate
    WAYS[way](spread)(*args, 0, 5, *to, degenerate, moved)
    assert to[0].tolist() == [[0] * 3, [1, 2, 3], [4, 5, 6], [0] * 3, [0] * 3]
    assert [values.tolist() for values in to[1:]] == [[0, k, k, 0, k + 0.5] for k in (1, 2, 3)]
    assert degenerate.tolist() == [False, True, True, False, True]
    assert moved.tolist() == [False, True, True, False, False]
