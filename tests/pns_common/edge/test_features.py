"""Each feature on one edge, by hand, and its range and symmetry as the set declares them."""

import numpy as np
import pytest

from pns_common.edge.features import FEATURE_COUNT, FEATURE_SETS
from pns_common.edge.frames import edge_frames, edge_stencil, face_normals
from pns_common.edge.orientation import FIRST_FACE, SYMMETRIC
from pns_common.topology import build_topology
from pns_common.vertex.rings import Rings
from tests.support.meshes import bumpy_sphere

# A roof: the edge from 0 to 1 is its crest, 4 units long; both sides fall by 3 over 4.
ROOF = np.array([[0.0, 0, 3], [4, 0, 3], [2, -4, 0], [2, 4, 0]])
SIDES = np.array([[0, 2, 1], [0, 1, 3]])


def row(name, points=ROOF, faces=SIDES):
    """The features of the crest, by name."""
    features, topology = FEATURE_SETS[name], build_topology(faces, len(points))
    edges = SYMMETRIC.order(topology, topology.interior)
    normals = face_normals(points, faces)
    fields = features.fields(Rings(topology, points, normals))
    stencil = edge_stencil(points, normals, edges.stencil, edges.faces, fields)
    names = [f"{feature.kind} {feature.vertices}".strip() for feature in features.features]
    values = features(stencil, edge_frames(stencil))
    assert values.shape == (1, FEATURE_COUNT[name])
    return dict(zip(names, values[0].tolist(), strict=True))


def test_the_papers_five_on_a_roof():
    five = row("paper-5")
    # Unit normals (0, ∓3, 4) / 5: their cosine is 7 / 25.
    assert five["x"] == pytest.approx(18 / 25)
    side = np.sqrt(4 + 16 + 9)
    for opposite in ("ac", "bc", "ad", "bd"):
        assert five[f"log {opposite}"] == pytest.approx(np.log(side / 4))


def test_the_sign_tells_a_crest_from_a_trough():
    crest, trough = row("signed-18"), row("signed-18", ROOF * [1, 1, -1], SIDES[:, ::-1])
    assert crest["dihedral"] == pytest.approx(24 / 25)
    turned = row("signed-18", ROOF, SIDES[:, ::-1])
    assert turned["dihedral"] == pytest.approx(-24 / 25)
    assert trough["dihedral"] == pytest.approx(24 / 25)  # turned over and mirrored: a crest again
    # At the ends both sides count alike, at c and d one of them does.
    assert crest["m T a"] == crest["m T b"] == crest["m B a"] == crest["m B b"] == 0
    assert crest["m B c"] == pytest.approx(-crest["m B d"])
    assert abs(crest["m B c"]) == pytest.approx(3 / 5)


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
