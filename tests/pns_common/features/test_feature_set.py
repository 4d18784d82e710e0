"""A feature set is its groups, side by side in their order."""

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.features.feature_set import FeatureGroup, FeatureSet
from pns_common.features.symmetry import Feature
from pns_common.geometry.frames import edge_frames, edge_stencil, face_normals
from pns_common.rules.control_level import control_level
from tests.support.meshes import icosphere

POINTS, FACES = icosphere(0)
TOPOLOGY = build_topology(FACES, 12)
STENCIL = edge_stencil(POINTS, face_normals(POINTS, FACES), TOPOLOGY.stencil, TOPOLOGY.edge_faces)
HEIGHT = FeatureGroup("height", (Feature("height"),), lambda s, f: [s.a[:, 2]])
ENDS = FeatureGroup(
    "ends",
    (Feature("x", "a"), Feature("x", "b", turn_over=-1)),
    lambda s, f: [s.a[:, 0], s.b[:, 0] * f.length],
)


def test_columns_stand_in_the_order_of_the_groups():
    both = FeatureSet("both", (ENDS, HEIGHT))
    frames = edge_frames(STENCIL)
    expected = [STENCIL.a[:, 0], STENCIL.b[:, 0] * frames.length, STENCIL.a[:, 2]]
    np.testing.assert_array_equal(both(STENCIL, frames), np.transpose(expected))
    assert both.count == 3
    assert [feature.kind for feature in both.features] == ["x", "x", "height"]


def test_one_signed_feature_makes_the_group_twice_as_large():
    assert len(FeatureSet("plain", (HEIGHT,)).symmetries.order) == 4
    assert len(FeatureSet("signed", (ENDS,)).symmetries.order) == 8


def test_vertex_data_is_asked_for_where_the_set_has_some():
    rings = control_level(POINTS, TOPOLOGY).rings
    assert FeatureSet("none", (HEIGHT,)).fields(rings) is None
    asked = FeatureSet("umbrellas", (HEIGHT,), lambda given: given.umbrella)
    assert asked.fields(rings) is rings.umbrella
