"""Features with a sign: on a roof by hand, on a closed mesh by their definition."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.features.edge_features import tilt_features
from pns_common.features.signed_features import normal_fields, vertex_fields
from pns_common.rules.control_level import control_level
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh
from tests.support.roof import ROOF, SIDES, on_roof


def test_the_sign_tells_a_crest_from_a_trough():
    crest, trough = on_roof("signed-18"), on_roof("signed-18", ROOF * [1, 1, -1], SIDES[:, ::-1])
    assert crest["dihedral"] == pytest.approx(24 / 25)
    turned = on_roof("signed-18", ROOF, SIDES[:, ::-1])
    assert turned["dihedral"] == pytest.approx(-24 / 25)
    assert trough["dihedral"] == pytest.approx(24 / 25)  # turned over and mirrored: a crest again
    # At the ends both sides count alike, at c and d one of them does.
    assert crest["m T a"] == crest["m T b"] == crest["m B a"] == crest["m B b"] == 0
    assert crest["m B c"] == pytest.approx(-crest["m B d"])
    assert abs(crest["m B c"]) == pytest.approx(3 / 5)


def test_vertex_data_are_the_mean_normal_and_the_umbrellas_height():
    points, faces = bumpy_sphere(3, subdivisions=0)
    plain = PlainMesh(points, faces)
    rings = control_level(points, build_topology(faces, len(points))).rings
    np.testing.assert_allclose(normal_fields(rings), plain.mean_normal, atol=1e-14)
    np.testing.assert_allclose(
        vertex_fields(rings), np.column_stack([plain.mean_normal, plain.height]), atol=1e-14
    )
    # Nobody computes an umbrella for a set without it.
    assert tilt_features.vertex_fields is normal_fields


def test_on_a_roof_without_a_ring_no_umbrella_has_a_height():
    assert [on_roof("signed-18")[f"umbrella {v}"] for v in "abcd"] == [0, 0, 0, 0]
