"""Edges cut out of a mesh keep their vertices, in order, and their classes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.edges_alone import edges_alone
from pns_common.connectivity.topology import EdgeClass, build_topology
from tests.support.meshes import manifolds, soups


@given(manifolds() | soups(), st.integers(0, 99))
def test_some_edges_alone_name_the_vertices_that_they_named(mesh, seed):
    whole = build_topology(mesh.faces, len(mesh.vertices))
    rows = np.flatnonzero(np.random.default_rng(seed).random(len(whole.edges)) < 0.5)
    edges, classes = whole.edges[rows], whole.edge_class[rows]
    vertices, alone = edges_alone(edges, classes, len(mesh.vertices))
    np.testing.assert_array_equal(vertices, np.unique(edges))
    np.testing.assert_array_equal(vertices[alone.edges].reshape(-1, 2), edges)
    np.testing.assert_array_equal(alone.stencil[:, :2], alone.edges)
    np.testing.assert_array_equal(alone.edge_class, classes)
    np.testing.assert_array_equal(alone.interior, np.flatnonzero(classes == EdgeClass.INTERIOR))
    assert alone.vertex_count == len(vertices)
    assert len(alone.faces) == 0
