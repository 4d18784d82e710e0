"""What kernels measure of a level, against its definitions read one vertex at a time."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.fused.kernels import rings as columns
from pns_common.fused.learned.edge_measures import edge_measures
from pns_common.fused.learned.rings import measure_bends, measure_pushes, measure_rings
from pns_common.fused.levels.face_measures import FaceMeasures
from tests.support.kernels import edges_built
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh

POINTS, FACES = bumpy_sphere(2, subdivisions=0)
EDGES, PLAIN = edges_built(Mesh(POINTS, FACES)), PlainMesh(POINTS, FACES)
FANS = np.zeros(len(POINTS), dtype=bool)


@pytest.fixture(params=[Blocks(1), Blocks(2, rows=5)], ids=["whole", "blocks"])
def blocks(request):
    return request.param


def measured(altitudes, blocks):
    at_faces = FaceMeasures(POINTS, EDGES.faces, blocks)
    at_edges = edge_measures(POINTS, EDGES, at_faces, altitudes, blocks)
    return at_edges, measure_rings(POINTS, EDGES, at_faces, at_edges, FANS, blocks)


@pytest.mark.parametrize("altitudes", [np.inf, 0.8])
def test_rings(blocks, altitudes):
    _, rings = measured(altitudes, blocks)
    named = None if altitudes == np.inf else altitudes
    for v in range(len(POINTS)):
        np.testing.assert_allclose(
            rings.fields[v], [*PLAIN.mean_normal[v], PLAIN.height[v]], atol=1e-14
        )
        mean, features = rings.means[v], PLAIN.ring_features(v)
        expected = {
            columns.MEAN_JUMP: features[0],
            columns.MEAN_BEND: features[1],
            columns.BEND_SQUARE: features[2],
            columns.RING_SQUARE: PLAIN.spoke_length(v) ** 2,
            columns.OPENING: features[7] * PLAIN.spoke_length(v),
            columns.LENGTH: features[8] * PLAIN.spoke_length(v),
            columns.NEAR_HEIGHT: features[6],
            columns.NEAR_JUMP: features[9],
            columns.MEAN_NETWORK_SQUARE: PLAIN.length_at(v, named) ** 2,
        }
        for column, value in expected.items():
            assert mean[column] == pytest.approx(value, abs=1e-14)
        np.testing.assert_allclose(mean[:3], PLAIN.umbrella(v), atol=1e-14)
    assert rings.valence.tolist() == [5] * len(POINTS)
    assert rings.smooth.all()


def test_pushes_and_bends(blocks):
    at_edges, rings = measured(np.inf, blocks)
    pushes = [PLAIN.push(v) for v in range(len(POINTS))]
    np.testing.assert_allclose(measure_pushes(rings, blocks), pushes, atol=1e-14)
    bends = measure_bends(at_edges.jumps, EDGES, blocks)
    for (a, b, c), bend in zip(FACES, bends, strict=True):
        jumps = [PLAIN.jump(*edge) for edge in ((a, b), (b, c), (c, a))]
        counted = [x * np.clip((0.6 - x) / 0.3, 0, 1) for x in jumps]
        assert bend == pytest.approx(np.mean(counted), abs=1e-14)
