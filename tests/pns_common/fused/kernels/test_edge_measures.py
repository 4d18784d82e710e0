"""The kernel that measures edges, on a tent."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.fused.kernels.edge_measures import HELD, measure_edges
from pns_common.fused.kernels.rings import measure_faces
from pns_common.fused.kernels.together import TOGETHER
from tests.support.kernels import WAYS, edges_built

# Over a square: four faces, the tip at 1.
POINTS = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1]])
MESH = edges_built(Mesh(POINTS, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])))
INNER = (MESH.edges == 4).any(axis=1)


def measured(way, altitudes=np.inf, begin=0, end=8):
    normals, areas = np.empty((4, 3)), np.empty((4, 4))
    measure_faces(POINTS, MESH.faces, 0, 4, normals, areas)
    mesh, out = (MESH.starts, MESH.edges, MESH.half_edges, MESH.edge_class), np.full((4, 8), -9.0)
    bounds, held = (altitudes, begin, end), np.empty(HELD * TOGETHER)
    WAYS[way](measure_edges)(POINTS, normals, areas, *mesh, *bounds, *out, held)
    return out


@pytest.mark.parametrize("way", WAYS)
def test_edges_of_a_tent(way):
    lengths, network_lengths, jumps, bends = measured(way)
    np.testing.assert_allclose(lengths, np.sqrt(2))
    np.testing.assert_array_equal(network_lengths, lengths)
    # Normals of neighbours have the inner product 1/3: x is 2/3, and the crest's sine √8 / 3.
    np.testing.assert_allclose(jumps[INNER], 2 / 3)
    np.testing.assert_allclose(bends[INNER], np.sqrt(8) / 3)
    assert not bends[~INNER].any()
    assert not jumps[~INNER].any()
    # The altitude of √3 over √2: .7 of it, and of .3 less, since √3/2 · 3 · .3 is less than 1.
    for altitudes, share in ((0.7, 1.0), (0.3, 0.6075)):
        _, network_lengths, *_ = measured(way, altitudes)
        np.testing.assert_allclose(network_lengths[INNER], altitudes * share * np.sqrt(3 / 2))
        np.testing.assert_array_equal(network_lengths[~INNER], lengths[~INNER])


@pytest.mark.parametrize("way", WAYS)
def test_only_the_rows_that_are_asked_for_are_written(way):
    some = measured(way, begin=3, end=5)
    np.testing.assert_array_equal(some[:, 3:5], measured(way)[:, 3:5])
    assert (np.delete(some, [3, 4], axis=1) == -9).all()
