"""The mask of a dart is its matrix's left eigenvector: a step leaves what it measures as it was."""

import numpy as np
import pytest

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.masks.limit.darts import dart_masks
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from tests.support.meshes import bow_tie
from tests.support.stars import star


@pytest.mark.parametrize("valence", [3, 4, 6, 9])
def test_a_dart_and_its_refined_ring_have_the_same_limit(valence):
    points, faces = star(valence, closed=True)
    topology = with_creases(build_topology(faces, len(points)), np.array([[0, 2]]))
    (mask,) = dart_masks(topology)
    assert mask.vertices.tolist() == [0]
    np.testing.assert_allclose(mask.weights.sum(), 1, atol=1e-15)
    assert mask.weights.min() >= 0
    far = topology.edges[:, ::-1].reshape(-1)[mask.spokes[0]]
    here = mask.weights[0] @ points[[0, *far]]
    # One step on the ring is what was there, and the edge vertices in its place.
    refined = np.concatenate(
        [loop_vertex_vertices(points, topology)[:1], loop_edge_vertices(points, topology)]
    )
    after = mask.weights[0] @ refined[[0, *(1 + mask.spokes[0] // 2)]]
    np.testing.assert_allclose(after, here, atol=1e-14)


def test_vertices_on_no_sharp_edge_or_on_several_are_no_darts():
    points, faces = star(5, closed=True)
    closed = build_topology(faces, len(points))
    assert [mask.vertices.tolist() for mask in dart_masks(closed)] == []
    two = with_creases(closed, np.array([[0, 1], [0, 3]]))
    assert not any(0 in mask.vertices for mask in dart_masks(two))
    assert dart_masks(build_topology(bow_tie()[1], 5)) == []
