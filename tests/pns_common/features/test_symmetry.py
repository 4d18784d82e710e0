"""The symmetries of a stencil are a group, and each feature set follows it."""

import numpy as np
import pytest

from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.symmetry import HALF_TURN, MIRROR, TURN_OVER, Feature, symmetries


@pytest.mark.parametrize("name", FEATURE_SETS)
def test_the_symmetries_are_a_group_of_involutions(name):
    group = FEATURE_SETS[name].symmetries
    elements = list(zip(group.order, group.signs, group.local, strict=True))
    known = {(tuple(o), tuple(s), tuple(d)) for o, s, d in elements}
    count, declared = FEATURE_SETS[name].count, FEATURE_SETS[name].features
    np.testing.assert_array_equal(elements[0][0], np.arange(count))
    assert len(known) == (8 if any(feature.turn_over < 0 for feature in declared) else 4)
    phi = np.random.default_rng(0).standard_normal(count)
    for order, signs, local in elements:
        np.testing.assert_array_equal(signs * (signs * phi[order])[order], phi)
        for other, more, too in elements:
            # First one, then the other: again one of them.
            both = (order[other], more * signs[other], local * too)
            assert tuple(map(tuple, both)) in known


def test_a_half_turn_renames_the_ends_and_the_sides():
    features = [Feature("log", side) for side in ("ac", "bc", "ad", "bd")]
    features += [Feature("tilt", end, half_turn=-1) for end in "ab"]
    features += [Feature("span", "cd")]  # of two that change places
    group = symmetries(features, [HALF_TURN])
    assert group.order[1].tolist() == [3, 2, 1, 0, 5, 4, 6]
    assert group.signs[1].tolist() == [1, 1, 1, 1, -1, -1, 1]
    assert group.local[1].tolist() == [-1, 1, -1]


def test_rotations_of_the_frame_keep_its_orientation_and_mirrors_turn_it():
    assert np.prod(HALF_TURN.local) == 1
    assert np.prod(TURN_OVER.local) == 1
    assert np.prod(MIRROR.local) == -1
