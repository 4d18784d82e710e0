"""Which faces are exact is followed, never assumed: at the rim, and behind the fold guard."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pns_common.formula.fold_guard import FoldGuard
from pns_common.pieces.exact import guarded_exact, may_fold, shrunk
from tests.support.meshes import grid, rotation


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.01, 2))
def test_no_scales_fold_what_may_not_fold(seed, size):
    rng = np.random.default_rng(seed)
    loop_points, asked = rng.standard_normal((2, 60, 3))
    faces, guard = np.arange(60).reshape(20, 3), FoldGuard(1.0)
    asked *= size * 0.2
    safe = ~may_fold(faces, loop_points, asked, guard.angle)
    for _ in range(20):
        scale = rng.choice([0, 0.25, 0.5, 1], 60) if rng.random() < 0.5 else rng.random(60)
        s = guard(faces[safe], loop_points, scale[:, None] * asked)
        assert (s == 1).all()


@given(st.integers(0, 99), st.floats(0.05, 1.57), st.floats(0, 1), st.floats(1, 9))
def test_what_turns_with_the_least_effort_may_fold(seed, angle, share, width):
    """The end of an area vector goes straight to the cone of θ: in a corner, or in two at once."""
    turn, faces, guard = rotation(np.random.default_rng(seed)), np.arange(3)[None], FoldGuard(angle)
    wide = np.array([[0.0, 0, 0], [width, 0, 0], [0, 1, 0]])
    way = 1.01 * np.sin(angle) * np.array([0, -np.sin(angle), np.cos(angle)])
    for at in (0, share):
        asked = np.outer([-at, -at, 1 - at], way)
        folds = (guard(faces, wide @ turn.T, asked @ turn.T) < 1).any()
        assert folds
        assert may_fold(faces, wide @ turn.T, asked @ turn.T, angle).all()


def test_what_loses_its_area_may_fold_whatever_the_angle():
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    asked = np.array([[0.0, 0, 0], [0, 0, 0], [0, -0.9995, 0]])
    assert (FoldGuard(1.5705)(np.arange(3)[None], flat, asked) < 1).all()
    assert may_fold(np.arange(3)[None], flat, asked, 1.5705).all()


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.01, 0.6))
def test_what_is_exact_behind_the_guard_hangs_on_nothing_unknown(seed, size):
    rng = np.random.default_rng(seed)
    points, faces = grid(16)
    asked = size / 16 * rng.standard_normal(points.shape)
    known = points[faces].mean(axis=1)[:, 0] > rng.uniform(-0.9, 0.5)
    exact = guarded_exact(known, faces, points, asked, 1.0)
    sure = np.unique(faces[exact])
    at_unknown = np.setdiff1d(np.arange(len(points)), np.unique(faces[known]))
    scales = []
    for _ in range(3):
        changed = asked.copy()
        changed[at_unknown] = rng.standard_normal((len(at_unknown), 3))
        scales.append(FoldGuard(1.0)(faces, points, changed)[sure])
    assert (scales[0] == scales[1]).all()
    assert (scales[0] == scales[2]).all()
    assert not (exact & ~known).any()


def test_a_face_beside_one_that_is_not_exact_or_at_the_rim_is_not_either():
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 3, 5], [5, 6, 4], [6, 5, 7]])
    whole = np.zeros(8, dtype=bool)
    exact = np.array([False, True, True, True, True, True])
    assert shrunk(exact, faces, whole).tolist() == [False, False, False, True, True, True]
    rim = np.arange(8) == 7
    assert shrunk(exact, faces, rim).tolist() == [False, False, False, True, True, False]
