"""Connectivity: orders, classes, fans and splits, against rules applied one element at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import ParameterError
from pns_common.mesh.topology import EdgeClass, _sort_edges, build_topology, split_triangles
from pns_common.parallel import Blocks
from tests.support.meshes import grid, manifolds, soups

CLASSES = EdgeClass.INTERIOR, EdgeClass.BOUNDARY, EdgeClass.IRREGULAR


def plain_edges(polygons):
    """Edges in order of first appearance, and their class, from the rules as they are stated."""
    ends, directions, whole = [], {}, {}
    for polygon in polygons:
        proper = len(set(polygon)) == len(polygon)
        for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
            edge = min(a, b), max(a, b)
            if edge not in directions:
                ends.append(edge)
            directions.setdefault(edge, []).append(a < b)
            whole[edge] = whole.get(edge, True) and proper
    classes = []
    for edge in ends:
        kind = EdgeClass.IRREGULAR
        if whole[edge] and len(directions[edge]) == 1:
            kind = EdgeClass.BOUNDARY
        elif whole[edge] and sorted(directions[edge]) == [False, True]:
            kind = EdgeClass.INTERIOR
        classes.append(kind)
    return ends, classes


@given(soups() | manifolds())
def test_edges_are_numbered_by_first_appearance_and_classified(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    ends, classes = plain_edges(mesh.faces.tolist())
    assert topology.edges.tolist() == [list(edge) for edge in ends]
    assert topology.edge_class.tolist() == classes


polygons = st.lists(st.lists(st.integers(0, 9), min_size=3, max_size=6), min_size=1, max_size=12)


@given(polygons)
def test_faces_of_any_degree_have_the_same_rules(faces):
    offsets = np.concatenate([[0], np.cumsum([len(face) for face in faces])])
    topology = build_topology((np.concatenate(faces), offsets), 10)
    ends, classes = plain_edges(faces)
    assert topology.edges.tolist() == [list(edge) for edge in ends]
    assert topology.edge_class.tolist() == classes


@given(soups() | manifolds())
def test_sorting_numbers_edges_as_chains_do(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    made = _sort_edges(topology.corners, topology.offsets, len(mesh.vertices))
    np.testing.assert_array_equal(made[0], topology.edges)
    np.testing.assert_array_equal(made[1], topology.half_edges)
    np.testing.assert_array_equal(made[2], topology.corner_edges)


@given(soups() | manifolds(), st.integers(0, 2**31))
def test_a_split_is_the_topology_of_its_faces(mesh, seed):
    """Arithmetic gives the edges, classes and sharpness that counting from nothing gives."""
    parent = build_topology(mesh.faces, len(mesh.vertices))
    rng = np.random.default_rng(seed)
    parent = parent.with_sharpness(rng.choice([0.0, 0.3, 1.0], len(parent.edges)))
    child = split_triangles(parent, Blocks())
    plain = build_topology(child.faces, child.vertex_count)
    np.testing.assert_array_equal(child.edges, plain.edges)
    np.testing.assert_array_equal(child.half_edges, plain.half_edges)
    np.testing.assert_array_equal(child.corner_edges, plain.corner_edges)
    inherited = {}
    for e, (a, b) in enumerate(parent.edges.tolist()):
        inherited |= {(a, parent.vertex_count + e): e, (b, parent.vertex_count + e): e}
    for row, edge in enumerate(map(tuple, child.edges.tolist())):
        if plain.edge_class[row] == EdgeClass.INTERIOR:
            e = inherited.get(edge)
            expected = 0.0 if e is None or parent.edge_class[e] in CLASSES[1:] else None
            wanted = parent.sharpness[e] if expected is None else expected
            assert child.sharpness[row] == wanted


@given(soups() | manifolds())
def test_fans_are_those_of_a_search_over_shared_edges(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    inside = {tuple(edge) for edge in topology.edges[topology.interior].tolist()}
    several = topology.multi_fan_vertices
    for v in range(len(mesh.vertices)):
        corners = [
            (f, i) for f, face in enumerate(mesh.faces.tolist()) for i in range(3) if face[i] == v
        ]
        fan = {corner: {corner} for corner in corners}
        for first in corners:
            for second in corners:
                sides = [
                    {tuple(sorted((v, int(mesh.faces[f][(i + k) % 3])))) for k in (1, 2)}
                    for f, i in (first, second)
                ]
                if first[0] != second[0] and sides[0] & sides[1] & inside:
                    joined = fan[first] | fan[second]
                    for corner in joined:
                        fan[corner] = joined
        assert several[v] == (len({frozenset(each) for each in fan.values()}) > 1)


def test_pairs_that_are_no_edges_are_refused_by_name():
    points, faces = grid(4)
    topology = build_topology(faces, len(points))
    rows = topology.rows_of(topology.edges[::-1].astype(np.int64))
    assert rows.tolist() == list(range(len(topology.edges)))[::-1]
    for pair, expected in (([0, 10**6], "vertices 0"), ([0, 0], "an edge")):
        with pytest.raises(ParameterError, match=rf"creases\[0\].*{expected}"):
            topology.rows_of(np.array([pair]))
