"""Lengths of edges and their logarithms, each measured once, whatever the blocks."""

import numpy as np

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.features.edge_features import SHORTEST
from pns_common.fused.edge_lengths import edge_lengths
from tests.support.kernels import edges_built
from tests.support.meshes import bumpy_sphere


def test_each_edge_has_its_length_and_one_without_the_logarithm_of_the_shortest():
    points, faces = bumpy_sphere(3, subdivisions=0)
    points[0] = points[faces[0, faces[0] != 0][0]]
    mesh = edges_built(Mesh(points, faces))
    expected = np.linalg.norm(points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]], axis=1)
    assert (expected == 0).any()
    for blocks in (Blocks(1), Blocks(2, rows=7)):
        measured = edge_lengths(points, mesh, blocks)
        np.testing.assert_allclose(measured.lengths, expected, rtol=1e-15)
        np.testing.assert_array_equal(
            measured.logs, np.log(np.where(expected > 0, measured.lengths, SHORTEST))
        )
