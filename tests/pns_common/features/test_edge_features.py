"""Each feature on one edge, by hand, and its range and symmetry as the set declares them."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.orientation import FIRST_FACE
from pns_common.geometry.frames import edge_stencil, face_normals
from pns_common.geometry.rings import Rings
from tests.support.meshes import bumpy_sphere
from tests.support.roof import on_roof


def test_the_papers_five_on_a_roof():
    five = on_roof("paper-5")
    # Unit normals (0, ∓3, 4) / 5: their cosine is 7 / 25.
    assert five["x"] == pytest.approx(18 / 25)
    side = np.sqrt(4 + 16 + 9)
    for opposite in ("ac", "bc", "ad", "bd"):
        assert five[f"log {opposite}"] == pytest.approx(np.log(side / 4))


@pytest.mark.parametrize("name", FEATURE_SETS)
def test_scale_changes_no_feature_and_all_keep_their_limits(name):
    points, faces = bumpy_sphere(2)
    features, topology = FEATURE_SETS[name], build_topology(faces, len(points))

    def values(points):
        edges = FIRST_FACE.order(topology, topology.interior)
        normals = face_normals(points, faces)
        fields = features.fields(Rings(topology, points, normals))
        stencil = edge_stencil(points, normals, edges.stencil, edges.faces, fields)
        return features(stencil, FIRST_FACE.frames(stencil))

    plain = values(points)
    np.testing.assert_allclose(values(2.0**20 * points), plain, rtol=0, atol=1e-13)
    limits = [feature.limit for feature in features.features]
    assert (np.abs(plain) <= np.array(limits) * (1 + 1e-12)).all()
