"""The symmetries of a stencil are a group, and the computed features follow it."""

import numpy as np
import pytest

from pns_common.mesh.topology import build_topology
from pns_common.model.card import EDGE_FEATURES
from pns_common.model.features import (
    FEATURE_SETS,
)
from pns_common.operator.formula import PaperRule, edge_inputs
from pns_common.operator.level import Level
from pns_common.parallel import Blocks
from pns_common.schemes import LOOP
from tests.support.meshes import bumpy_sphere


@pytest.mark.parametrize("name", FEATURE_SETS)
def test_the_symmetries_are_a_group_of_involutions(name):
    group, declared = FEATURE_SETS[name].symmetries, FEATURE_SETS[name].features
    elements = list(zip(group.order, group.signs, group.local, strict=True))
    known = {(tuple(o), tuple(s), tuple(d)) for o, s, d in elements}
    count = FEATURE_SETS[name].count
    assert EDGE_FEATURES[name] == count == int(name.partition("-")[2])
    np.testing.assert_array_equal(elements[0][0], np.arange(count))
    size = 8 if any(f.turn_over < 0 for f in declared) else 4
    assert len(known) == size
    phi = np.random.default_rng(0).standard_normal(count)
    for order, signs, local in elements:
        np.testing.assert_array_equal(signs * (signs * phi[order])[order], phi)
        for other, more, too in elements:
            # First one, then the other: again one of them.
            both = (order[other], more * signs[other], local * too)
            assert tuple(map(tuple, both)) in known


def edges_of(points, faces, name):
    """The stencil's features and frames at every edge of a closed mesh, by its ends."""
    level = Level(points, build_topology(faces, len(points)), LOOP, 1.0, Blocks())
    rule = PaperRule(lambda phi: phi[:, :3], FEATURE_SETS[name], True, 1.0, 1.0)
    at = edge_inputs(level, rule, level.topology.interior)
    keys = level.topology.edges[at.rows].astype(int)
    return {
        tuple(key): (phi, basis.reshape(3, 3))
        for key, phi, basis in zip(keys.tolist(), at.features, at.basis, strict=True)
    }


def test_features_keep_their_limits():
    points, faces = bumpy_sphere(bump=0.6)
    rows = np.array([phi for phi, _ in edges_of(points, faces, "signed-18").values()])
    limits = [feature.limit for feature in FEATURE_SETS["signed-18"].features]
    assert (np.abs(rows).max(axis=0) <= limits).all()
