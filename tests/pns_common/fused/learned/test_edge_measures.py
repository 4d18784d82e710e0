"""What kernels measure of edges, against its definitions read one edge at a time."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.features.edge_features import SHORTEST
from pns_common.fused.learned.edge_measures import edge_measures, log_lengths
from pns_common.fused.levels.face_measures import FaceMeasures
from tests.support.kernels import edges_built
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh

BLOCKS = Blocks(1), Blocks(2, rows=7)


@pytest.mark.parametrize("altitudes", [np.inf, 0.8])
def test_each_edge_is_measured_whatever_the_blocks(altitudes):
    points, faces = bumpy_sphere(2, subdivisions=1)
    mesh, plain = edges_built(Mesh(points, faces)), PlainMesh(points, faces)
    named, pairs = None if altitudes == np.inf else altitudes, mesh.edges.tolist()
    for blocks in BLOCKS:
        at_faces = FaceMeasures(points, mesh.faces, blocks)
        made = edge_measures(points, mesh, at_faces, altitudes, blocks)
        lengths = np.linalg.norm(points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]], axis=1)
        np.testing.assert_allclose(made.lengths, lengths, rtol=1e-15)
        networks = [plain.length(a, b, named) for a, b in pairs]
        np.testing.assert_allclose(made.network_lengths, networks, atol=1e-14)
        np.testing.assert_allclose(made.jumps, [plain.jump(a, b) for a, b in pairs], atol=1e-14)
        assert len(made.without_jumps().jumps) == len(made.without_bends().bends) == 0


def test_an_edge_without_length_has_the_logarithm_of_the_shortest():
    lengths = np.array([0.0, 3.0, SHORTEST / 2, 1e-200])
    expected = np.log(np.maximum(lengths, SHORTEST))
    for blocks in BLOCKS:
        np.testing.assert_array_equal(log_lengths(lengths, blocks), expected)
