"""Welding within a tolerance, against the definition over all pairs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.meshes.weld import near_labels, weld, weld_within
from tests.support.gltf.shapes import octahedron


def components(near):
    """Components of a symmetric relation, the slow way."""
    reach = near.copy()
    for _ in range(len(near)):
        reach = reach | (reach.astype(int) @ near.astype(int) > 0)
    return reach


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.floats(0.01, 0.6))
def test_near_points_join_and_far_ones_do_not(seed, count, distance):
    rng = np.random.default_rng(seed)
    points, apart = rng.random((count, 3)) - 0.5, rng.integers(0, 2, count)
    labels = near_labels(points, distance, apart)
    same = labels[:, None] == labels
    gap = np.abs(points[:, None] - points).max(axis=2)
    alike = apart[:, None] == apart
    assert same[components((gap < distance) & alike)].all()
    assert not same[~components((gap <= 2 * distance) & alike)].any()


def test_a_long_chain_is_one():
    points = np.random.default_rng(0).permutation(20000)[:, None] * np.array([1.0, 0, 0])
    assert not near_labels(points, 1.01, np.zeros(20000, dtype=np.int64)).any()


def test_a_crowd_in_one_place_costs_no_more():
    points = np.random.default_rng(0).random((200_000, 3))
    points[0] = 1e6
    assert len(np.unique(near_labels(points, 1.0, np.zeros(200_000, dtype=np.int64)))) == 2


def test_what_moves_apart_stays_apart():
    shape = octahedron()
    flat = shape["indices"].reshape(-1)
    side = np.arange(24) // 12
    apart = weld(shape["POSITION"][flat], np.arange(24).reshape(-1, 3), side)
    assert len(apart.points) == 10
    assert len(weld_within(apart, 1e-3, None, side).points) == 10


def test_coincident_points_join_at_any_tolerance():
    points = np.zeros((3, 3))
    assert near_labels(points, 1e-300, np.zeros(3, dtype=np.int64)).tolist() == [0, 0, 0]
