"""Edges, classes, stencils, fans and the split, against slow dictionaries."""

import numpy as np
import pytest
from hypothesis import given

from pns_common import Mesh
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import (
    EdgeClass,
    build_topology,
    children_across,
    split,
    stable_sort,
)
from tests.support.meshes import (
    bow_tie,
    grid,
    icosphere,
    manifolds,
    one_way_pair,
    soups,
    three_pages,
)


def slow_edges(faces):
    """Edge -> list of (face, from, to, opposite), in order of first appearance."""
    sides = {}
    for face, (a, b, c) in enumerate(faces.tolist()):
        for s, t, o in [(a, b, c), (b, c, a), (c, a, b)]:
            sides.setdefault((min(s, t), max(s, t)), []).append((face, s, t, o))
    return sides


def slow_class(uses, faces):
    proper = all(len(set(faces[face].tolist())) == 3 for face, *_ in uses)
    if proper and len(uses) == 1:
        return EdgeClass.BOUNDARY
    opposed = len(uses) == 2 and uses[0][1:3] == uses[1][1:3][::-1]
    return EdgeClass.INTERIOR if proper and opposed else EdgeClass.IRREGULAR


@given(soups() | manifolds())
def test_edges_are_numbered_by_first_appearance_and_classified(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    slow = slow_edges(mesh.faces)
    assert [tuple(edge) for edge in topology.edges.tolist()] == list(slow)
    for edge, uses in enumerate(slow.values()):
        kind = slow_class(uses, mesh.faces)
        assert topology.edge_class[edge] == kind
        faces, opposites = topology.edge_faces[edge].tolist(), topology.stencil[edge, 2:].tolist()
        if kind == EdgeClass.INTERIOR:
            assert faces == [use[0] for use in uses]
            assert faces[0] < faces[1]
            assert opposites == [use[3] for use in uses]
        else:
            assert faces == opposites == [-1, -1]
    for face, (a, b, c) in enumerate(mesh.faces.tolist()):
        ends = topology.edges[topology.face_edges[face]].tolist()
        assert ends == [sorted(pair) for pair in [(a, b), (b, c), (c, a)]]


@given(soups() | manifolds())
def test_split_numbers_vertices_and_faces_as_promised(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    edge_vertex = {
        tuple(edge): len(mesh.vertices) + e for e, edge in enumerate(topology.edges.tolist())
    }
    expected = []
    for a, b, c in mesh.faces.tolist():
        ab, bc, ca = (edge_vertex[min(p), max(p)] for p in [(a, b), (b, c), (c, a)])
        expected += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    np.testing.assert_array_equal(split(topology), expected)


@given(soups() | manifolds())
def test_children_inside_and_across_are_the_interior_edges_of_the_split_mesh(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    count = topology.vertex_count + len(topology.edges)
    child = build_topology(split(topology), count)
    expected = sorted(map(sorted, child.edge_faces[child.interior].tolist()))
    centres = 4 * np.arange(len(mesh.faces)) + 3
    inside = [[centre, centre - i] for centre in centres.tolist() for i in (1, 2, 3)]
    across = np.concatenate(children_across(topology, topology.interior)).tolist()
    listed = sorted(map(sorted, inside + across))
    proper = all(len(set(face)) == 3 for face in mesh.faces.tolist())
    if proper:
        assert listed == expected


def slow_fans(faces, vertex):
    """Number of components of the faces at a vertex, joined across interior edges there."""
    slow = slow_edges(faces)
    incident = [f for f, face in enumerate(faces.tolist()) if vertex in face]
    group = {f: {f} for f in incident}
    for edge, uses in slow.items():
        if vertex in edge and slow_class(uses, faces) == EdgeClass.INTERIOR:
            first, second = uses[0][0], uses[1][0]
            merged = group[first] | group[second]
            for f in merged:
                group[f] = merged
    return len({frozenset(g) for g in group.values()})


@given(soups() | manifolds())
def test_vertices_with_several_fans_are_found(mesh):
    if any(len(set(face)) < 3 for face in mesh.faces.tolist()):
        return
    marked = build_topology(mesh.faces, len(mesh.vertices)).multi_fan_vertices
    expected = [slow_fans(mesh.faces, v) > 1 for v in range(len(mesh.vertices))]
    np.testing.assert_array_equal(marked, expected)


def test_a_closed_ring_may_have_one_crease_that_ends_there():
    faces = grid(5)[1]
    plain = build_topology(faces, 25)
    inner = [6, 7, 8, 11, 12, 13, 16, 17, 18]
    assert np.flatnonzero(plain.smooth_vertices).tolist() == inner
    assert plain.ringed_vertices is plain.smooth_vertices
    creased = with_creases(plain, np.array([[10, 11], [11, 12], [12, 13], [7, 8]]))
    assert np.flatnonzero(creased.smooth_vertices).tolist() == [6, 16, 17, 18]
    # 13, 7 and 8 are darts; 11 and 12 lie between two, 10 on the boundary.
    assert np.flatnonzero(creased.ringed_vertices).tolist() == [6, 7, 8, 13, 16, 17, 18]
    # Where no ring closes one sharp edge may end, too: two faces that both run along it.
    pair = build_topology(*one_way_pair()[1:], len(one_way_pair()[0]))
    assert not pair.ringed_vertices.any()


def test_two_closed_fans_on_one_vertex_are_two():
    vertices, faces = icosphere(0)
    both = np.concatenate([faces, np.where(faces == 0, 0, faces + len(vertices))])
    marked = build_topology(both, 2 * len(vertices)).multi_fan_vertices
    assert np.flatnonzero(marked).tolist() == [0]


@pytest.mark.parametrize(
    ("shape", "interior", "boundary", "irregular"),
    [(bow_tie, 0, 6, 0), (three_pages, 0, 6, 1), (one_way_pair, 0, 4, 1), (icosphere, 120, 0, 0)],
)
def test_edge_classes_of_named_shapes(shape, interior, boundary, irregular):
    vertices, faces = shape()
    mesh = Mesh(vertices, faces)
    classes = build_topology(mesh.faces, len(mesh.vertices)).edge_class
    assert np.bincount(classes, minlength=3).tolist() == [interior, boundary, irregular]


@pytest.mark.parametrize("largest", [7, 2**62])
def test_stable_sort_with_keys_that_can_and_cannot_be_packed(largest):
    key = np.array([largest, 5, largest, 1, 5])
    ordered, order = stable_sort(key)
    np.testing.assert_array_equal(order, np.argsort(key, kind="stable"))
    np.testing.assert_array_equal(ordered, np.sort(key))
