"""The mask of a dart is its matrix's left eigenvector: a step leaves what it measures as it was."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.masks.limit.darts import dart_masks
from pns_common.masks.limit.normals import limit_normals
from pns_common.masks.limit.positions import limit_positions
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from tests.support.meshes import bow_tie, soups
from tests.support.stars import star


@pytest.mark.parametrize("valence", [3, 4, 6, 9, 300])
def test_a_dart_and_its_refined_ring_have_the_same_limit(valence):
    points, faces = star(valence, closed=True)
    topology = with_creases(build_topology(faces, len(points)), np.array([[0, 2]]))
    mask = dart_masks(topology)
    assert mask.vertices.tolist() == [0]
    np.testing.assert_allclose(mask.weights.sum() + mask.centre, 1, atol=1e-15)
    assert mask.weights.min() >= 0
    far = topology.edges[:, ::-1].reshape(-1)[mask.spokes]
    here = mask.centre * points[0] + mask.weights @ points[far]
    # One step on the ring is what was there, and the edge vertices in its place.
    own = loop_vertex_vertices(points, topology)[0]
    after = (
        mask.centre * own + mask.weights @ loop_edge_vertices(points, topology)[mask.spokes // 2]
    )
    np.testing.assert_allclose(after, here, atol=1e-14)


@given(soups(), st.integers(0, 99))
def test_masks_are_the_left_eigenvectors_of_the_whole_step_whatever_faces_there_are(mesh, seed):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = np.random.default_rng(seed).permutation(topology.interior)[:3]
    topology = with_creases(topology, topology.edges[rows])
    points = np.random.default_rng(seed).standard_normal((len(mesh.vertices), 3))
    mask, far = dart_masks(topology), topology.edges[:, ::-1].reshape(-1)
    moved, middles = loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)
    for number, vertex in enumerate(mask.vertices):
        own = mask.of_dart == number
        spokes, weights, centre = mask.spokes[own], mask.weights[own], mask.centre[number]
        if not np.isin(topology.stencil[spokes // 2, 2:], [-1, *far[spokes]]).all():
            continue  # a face that has the vertex twice
        here = centre * points[vertex] + weights @ points[far[spokes]]
        after = centre * moved[vertex] + weights @ middles[spokes // 2]
        np.testing.assert_allclose(after, here, atol=1e-13)


def test_many_spokes_take_no_longer_each_than_few():
    """A matrix of so many rows would have 80 gigabytes."""
    points, faces = star(100_000, closed=True)
    topology = with_creases(build_topology(faces, len(points)), np.array([[0, 2]]))
    mask = dart_masks(topology)
    assert len(mask.weights) == 100_000
    assert np.isfinite(limit_positions(points, topology)).all()
    normals = limit_normals(points, topology).vertices
    np.testing.assert_allclose(np.linalg.norm(normals[0]), 1, atol=1e-12)


def test_vertices_on_no_sharp_edge_or_on_several_are_no_darts():
    points, faces = star(5, closed=True)
    closed = build_topology(faces, len(points))
    assert dart_masks(closed).vertices.tolist() == []
    two = with_creases(closed, np.array([[0, 1], [0, 3]]))
    assert 0 not in dart_masks(two).vertices
    assert dart_masks(build_topology(bow_tie()[1], 5)).vertices.tolist() == []
