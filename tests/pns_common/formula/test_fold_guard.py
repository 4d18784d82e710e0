"""The fold guard: scales that end every fold, found without an order."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common.base.blocks import Blocks
from pns_common.formula.fold_guard import FoldGuard, turned
from tests.support.meshes import bumpy_sphere, grid, rotation

FLAT, FACES = grid(5)


def angles(faces, before, after):
    normals = []
    for points in (before, after):
        a, b, c = points[faces].transpose(1, 0, 2)
        area = np.cross(b - a, c - a)
        normals.append(area / np.linalg.norm(area, axis=1, keepdims=True))
    return np.arccos(np.clip(np.sum(normals[0] * normals[1], axis=1), -1, 1))


@given(st.integers(0, 2**31), st.floats(0.01, 1e6), st.floats(0.05, 1.5))
def test_no_face_turns_by_more_than_the_angle(seed, size, angle):
    delta = size * np.random.default_rng(seed).standard_normal(FLAT.shape)
    scale = FoldGuard(angle)(FACES, FLAT, delta)
    moved = FLAT + scale[:, None] * delta
    assert angles(FACES, FLAT, moved).max() <= angle + 1e-7
    assert set(np.unique(scale)) <= {0.0, *0.5 ** np.arange(31)}


def test_what_does_not_fold_is_left_alone():
    delta = np.zeros_like(FLAT)
    delta[12] = [0, 0, 0.4]  # 39 degrees at most, where a grid cell is 0.5 wide
    assert (FoldGuard(np.radians(75))(FACES, FLAT, delta) == 1).all()
    common = np.tile([3.0, -8.0, 5.0], (len(FLAT), 1))
    assert (FoldGuard(0.01)(FACES, FLAT, common) == 1).all()


def test_only_the_corners_of_folded_faces_are_scaled():
    points, faces = grid(9)
    delta = np.zeros_like(points)
    delta[40] = [2.0, 0, 0]  # the middle vertex, pushed over its neighbours
    scale = FoldGuard(np.radians(75))(faces, points, delta)
    near = np.unique(faces[(faces == 40).any(axis=1)])
    assert scale[40] < 1
    assert np.isin(np.flatnonzero(scale < 1), near).all()


@given(st.integers(0, 2**31))
def test_knows_no_numbering_and_no_pose(seed):
    rng = np.random.default_rng(seed)
    points, faces = bumpy_sphere(seed)
    delta = 0.5 * rng.standard_normal(points.shape)
    guard = FoldGuard(np.radians(60))
    scale = guard(faces, points, delta)
    order = rng.permutation(len(points))
    place = np.argsort(order)
    shuffled = rng.permutation(place[faces])
    np.testing.assert_array_equal(guard(shuffled, points[order], delta[order]), scale[order])
    turn = rotation(rng)
    np.testing.assert_array_equal(guard(faces, 4 * points, 4 * delta), scale)
    moved = guard(faces, points @ turn.T, delta @ turn.T)
    assert (moved != scale).mean() < 0.05  # an angle may equal the limit to the last bit


@pytest.mark.parametrize("blocks", [Blocks(1, 7), Blocks(3, 50)])
def test_blocks_threads_and_backends_find_the_same_scales(blocks):
    points, faces = bumpy_sphere(0, subdivisions=2)
    delta = np.random.default_rng(0).standard_normal(points.shape)
    guard = FoldGuard(np.radians(75))
    scale = guard(faces, points, delta)
    assert (scale < 1).any()
    np.testing.assert_array_equal(guard(faces, points, delta, blocks), scale)
    on_torch = guard(faces, torch.tensor(points), torch.tensor(delta))
    np.testing.assert_array_equal(on_torch, scale)


def test_a_hopeless_face_ends_as_loops():
    """A sliver that folds at any scale that halving reaches: it is switched off, and it alone."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-11, 0], [0.5, -1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    delta = np.array([[0, 0, 0], [0, 0, 0], [0, -1, 0.3], [0, 0, 0.0]], dtype=float)
    scale = FoldGuard(np.radians(75))(faces, points, delta)
    np.testing.assert_array_equal(scale[:3], 0.0)
    assert scale[3] == 1


@pytest.mark.parametrize("halvings", [1, 2, 7, 25])
def test_a_face_is_scaled_no_further_than_it_must_be(halvings):
    """A corner that is lifted turns its face by the arctangent of its height."""
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    delta = np.zeros((3, 3))
    delta[2, 2] = 1.9 * 2.0 ** (halvings - 1)
    scale = FoldGuard(np.radians(45))(np.array([[0, 1, 2]]), triangle, delta)
    np.testing.assert_array_equal(scale, 0.5**halvings)


@pytest.mark.parametrize(("left", "is_kept"), [(0.0011, True), (0.0009, False)])
def test_a_face_may_lose_all_but_a_thousandth_of_its_area(left, is_kept):
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    delta = np.zeros((3, 3))
    delta[2, 1] = left - 1
    scale = FoldGuard(0.01)(np.array([[0, 1, 2]]), triangle, delta)
    assert (scale == 1).all() == is_kept


def test_faces_without_area_are_left_out_and_shrinking_ones_are_not():
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float)
    triangle = np.array([[0, 1, 2]])
    lifted = line + np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]])
    assert not turned(triangle, line, lifted, 0.5)[0]
    assert turned(triangle, lifted, line, 0.5)[0]
    assert not turned(triangle, lifted, lifted, 0.5)[0]


def test_displacements_that_are_no_numbers_do_not_keep_it_busy():
    delta = np.full_like(FLAT, np.nan)
    assert len(FoldGuard(1.0)(FACES, FLAT, delta)) == len(FLAT)


def rim(width: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a flat band of narrow faces, and those of one row as shared."""
    x = np.arange(5.0)
    points = np.concatenate([np.c_[x, 0 * x, 0 * x], np.c_[x, 0 * x + width, 0 * x]])
    quads = np.arange(4)
    faces = np.concatenate([np.c_[quads, quads + 1, quads + 6], np.c_[quads, quads + 6, quads + 5]])
    return points, faces, np.arange(10) < 5


def test_a_shared_boundary_stays_where_the_inside_goes_along_with_it():
    """A narrow rim that is lifted as a whole folds nowhere: neither side of it is held back."""
    points, faces, shared = rim(0.01)
    lifted = np.tile([0.0, 0.0, 0.1], (len(points), 1))
    assert (FoldGuard(np.radians(75))(faces, points, lifted, shared=shared) == 1).all()


def test_a_shared_boundary_gives_way_only_to_what_it_folds_by_itself():
    points, faces, shared = rim(0.01)
    guard = FoldGuard(np.radians(75))
    lifted = np.where(shared[:, None], [0.0, 0.0, 0.1], 0.0)
    alone = guard(faces, points, lifted, shared=shared)
    assert alone.max() < 1  # nobody goes along: all corners give way together
    inside = np.where(shared[:, None], 0.0, [0.0, 0.0, 0.1])
    held = guard(faces, points, inside + np.array([0.0, 0.0, 0.001]), shared=shared)
    assert (held[shared] == 1).all()
    assert held[~shared].max() < 1


@given(st.integers(0, 2**31), st.floats(0.01, 1e3))
def test_what_lies_inside_lowers_no_shared_vertex_that_folds_nothing_by_itself(seed, size):
    rng = np.random.default_rng(seed)
    shared = rng.random(len(FLAT)) < 0.3
    delta = size * rng.standard_normal(FLAT.shape)
    delta[shared] *= 0.01 / size
    scale = FoldGuard(np.radians(75))(FACES, FLAT, delta, shared=shared)
    assert (scale[shared] == 1).all()
    moved = FLAT + scale[:, None] * delta
    assert angles(FACES, FLAT, moved).max() <= np.radians(75) + 1e-7
