"""The symmetries of a stencil are a group, and the computed features follow it."""

import numpy as np
import pytest

from pns_common.mesh.topology import build_topology
from pns_common.model.card import EDGE_FEATURES
from pns_common.model.features import (
    FEATURE_SETS,
    TURN_OVER,
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


# Element i of a group is the product of the generators whose bits i has.
TURNED_OVER, MIRRORED = 4, 2


SIGNED = [name for name, seen in FEATURE_SETS.items() if TURN_OVER in seen.generators]


@pytest.mark.parametrize("name", SIGNED)
def test_faces_turned_over_permute_and_sign_the_features(name):
    points, faces = bumpy_sphere()
    seen, turned = edges_of(points, faces, name), edges_of(points, faces[:, ::-1], name)
    group = FEATURE_SETS[name].symmetries
    order, signs = group.order[TURNED_OVER], group.signs[TURNED_OVER]
    for key, (phi, basis) in seen.items():
        np.testing.assert_allclose(turned[key][0], signs * phi[order], atol=1e-13)
        expected = group.local[TURNED_OVER][:, None] * basis
        np.testing.assert_allclose(turned[key][1], expected, atol=1e-13)


@pytest.mark.parametrize("name", FEATURE_SETS)
def test_a_mirror_permutes_and_signs_the_features(name):
    points, faces = bumpy_sphere()
    seen = edges_of(points, faces, name)
    mirrored = edges_of(points * [-1, 1, 1], faces[:, ::-1], name)
    group = FEATURE_SETS[name].symmetries
    order, signs = group.order[MIRRORED], group.signs[MIRRORED]
    for key, (phi, basis) in seen.items():
        np.testing.assert_allclose(mirrored[key][0], signs * phi[order], atol=1e-13)
        expected = group.local[MIRRORED][:, None] * basis * [-1, 1, 1]
        np.testing.assert_allclose(mirrored[key][1], expected, atol=1e-13)


@pytest.mark.parametrize("name", FEATURE_SETS)
def test_other_numbers_of_the_ends_are_a_half_turn(name):
    points, faces = bumpy_sphere()
    count = len(points)
    seen = edges_of(points, faces, name)
    other = edges_of(points[::-1].copy(), count - 1 - faces, name)
    group = FEATURE_SETS[name].symmetries
    for (a, b), (phi, basis) in seen.items():
        again, frame = other[count - 1 - b, count - 1 - a]
        np.testing.assert_allclose(again, group.signs[1] * phi[group.order[1]], atol=1e-13)
        np.testing.assert_allclose(frame, group.local[1][:, None] * basis, atol=1e-13)


def test_features_keep_their_limits():
    points, faces = bumpy_sphere(bump=0.6)
    rows = np.array([phi for phi, _ in edges_of(points, faces, "signed-18").values()])
    limits = [feature.limit for feature in FEATURE_SETS["signed-18"].features]
    assert (np.abs(rows).max(axis=0) <= limits).all()
