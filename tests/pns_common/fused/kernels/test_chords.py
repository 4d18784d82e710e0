"""Angles and flips among some children, from their normals one by one."""

import numpy as np
import pytest

from pns_common.fused.kernels.chords import chords_between, chords_inside, flipped_among
from pns_common.geometry.frames import face_normals
from tests.support.kernels import WAYS

RNG = np.random.default_rng(0)
POINTS, LOOP = RNG.standard_normal((2, 30, 3))
# Two faces of the control mesh; the seventh child has no area.
CHILDREN = RNG.permutation(30)[:24].reshape(8, 3).astype(np.int32)
CHILDREN[6, 2] = CHILDREN[6, 0]
NORMALS, COUNTERPARTS = (face_normals(points, CHILDREN) for points in (POINTS, LOOP))
FACES = np.array([0, 1])


def chord(i, j):
    if not (NORMALS[i].any() and NORMALS[j].any()):
        return 0.0
    return np.sum((NORMALS[i] - NORMALS[j]) ** 2)


@pytest.mark.parametrize("way", WAYS)
def test_the_middle_child_stands_at_the_largest_angle_to_another(way):
    inside = WAYS[way](chords_inside)
    expected = [max(chord(4 * f + 3, 4 * f + i) for i in range(3)) for f in FACES]
    assert inside(POINTS, CHILDREN, FACES[:1]) == pytest.approx(expected[0], rel=1e-14)
    assert inside(POINTS, CHILDREN, FACES) == pytest.approx(max(expected), rel=1e-14)
    assert inside(POINTS, CHILDREN, FACES[:0]) == 0


@pytest.mark.parametrize("way", WAYS)
def test_pairs_of_children_are_told_by_the_largest(way):
    first, second = np.array([0, 2, 6]), np.array([5, 7, 1])
    largest = WAYS[way](chords_between)(POINTS, CHILDREN, first, second)
    expected = max(chord(i, j) for i, j in zip(first, second, strict=True))
    assert largest == pytest.approx(expected, rel=1e-14)
    assert WAYS[way](chords_between)(POINTS, CHILDREN, first[2:], second[2:]) == 0


@pytest.mark.parametrize("way", WAYS)
def test_flipped_children_oppose_their_counterparts(way):
    opposed = np.sum(NORMALS * COUNTERPARTS, axis=1) < 0
    flipped = WAYS[way](flipped_among)
    assert flipped(POINTS, LOOP, CHILDREN, FACES) == opposed.sum() > 0
    for f in FACES:
        turned = POINTS.copy()
        turned[CHILDREN[4 * f : 4 * f + 4]] = LOOP[CHILDREN[4 * f : 4 * f + 4]]
        assert flipped(turned, LOOP, CHILDREN, FACES[f : f + 1]) == 0
        assert flipped(turned, LOOP, CHILDREN, FACES) == opposed.reshape(2, 4)[1 - f].sum()
