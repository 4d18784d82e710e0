"""What an old vertex sees and gets, by the plain formula one vertex at a time."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.vertex_correction import correct, correct_scale_free, look_around
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.face_measures import FaceMeasures
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh, shortened

POINTS, FACES = bumpy_sphere(3, subdivisions=0, bump=0.3)
MESH, PLAIN = edges_built(Mesh(POINTS, FACES)), PlainMesh(POINTS, FACES)
COUNT, RNG = 12, np.random.default_rng(1)
FACE_MEASURES, NO_FANS = FaceMeasures(POINTS, MESH.faces, Blocks(1)), np.zeros(COUNT, dtype=bool)
RINGS = Surroundings(POINTS, MESH, FACE_MEASURES, NO_FANS, 1.0, Blocks(1), altitudes=0.8).rings
AROUND = RINGS.means, RINGS.fields
# In another order than they have, and not all of them.
CHOSEN = np.array([7, 2, 11, 5], dtype=np.int32)
Z, GATE = RNG.standard_normal((4, 3)), RNG.random(4)
PER_LENGTH = RNG.uniform(0.05, 0.3, 4)


def outputs():
    return np.zeros((COUNT, 3)), np.zeros(COUNT), np.zeros(COUNT), np.zeros(COUNT)


@pytest.mark.parametrize("way", WAYS)
def test_features_and_what_the_gate_reads(way):
    features, mean_jump = np.empty((3, 10)), np.empty(3)
    WAYS[way](look_around)(*AROUND, CHOSEN, 1, 4, features, mean_jump)
    expected = [PLAIN.ring_features(v) for v in CHOSEN[1:]]
    np.testing.assert_allclose(features, expected, atol=1e-13)
    np.testing.assert_allclose(mean_jump, [PLAIN.mean_jump[v] for v in CHOSEN[1:]], atol=1e-14)


@pytest.mark.parametrize("way", WAYS)
def test_the_correction_of_format_2(way):
    delta, ratio, gate, envelope = out = outputs()
    WAYS[way](correct)(*AROUND, CHOSEN, 0, 4, *out, Z, GATE, PER_LENGTH)
    for i, v in enumerate(CHOSEN):
        vector = shortened(shortened(Z[i], 1) @ np.array(PLAIN.ring_vectors(v)), 1)
        bound = PER_LENGTH[i] * PLAIN.spoke_length(v) ** 2
        np.testing.assert_allclose(delta[v], GATE[i] * bound * vector, atol=1e-15)
        assert (gate[v], envelope[v]) == (GATE[i], pytest.approx(bound))
        assert ratio[v] == pytest.approx(np.linalg.norm(delta[v]) / bound)
    assert not np.delete(delta, CHOSEN, axis=0).any()


@pytest.mark.parametrize("way", WAYS)
def test_the_scale_free_correction(way):
    prior = 0.03 * RNG.standard_normal((COUNT, 3))
    delta, _, _, envelope = out = outputs()
    given = *AROUND, prior, 0.0, 0.5, CHOSEN, 0, 4
    WAYS[way](correct_scale_free)(*given, *out, Z, GATE, PER_LENGTH)
    for i, v in enumerate(CHOSEN):
        combined = shortened(Z[i], 1) @ np.array(PLAIN.ring_vectors(v))
        wanted = prior[v] + 0.5 * PLAIN.length_at(v, 0.8) * combined
        bound = PER_LENGTH[i] * PLAIN.spoke_length(v) ** 2
        np.testing.assert_allclose(delta[v], GATE[i] * shortened(wanted, bound), atol=1e-15)
        assert envelope[v] == pytest.approx(bound)
