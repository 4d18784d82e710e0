"""Rows that are equal share a number; numbers follow first appearance; boxes are numpy's own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pns_common.mesh import rows as module
from pns_common.mesh.rows import (
    cross,
    disjoint_faces,
    distinct_rows,
    dot,
    extent,
    first_places,
    marked,
    norm,
    number_by_first_appearance,
    unit,
)

# Values whose sums and bits are easy to confuse.
VALUES = np.array([0, 1, 2, 1e-45, 3e38], dtype=np.float32).tolist()
ROWS = hnp.arrays(
    np.float32,
    st.tuples(st.integers(1, 40), st.integers(1, 5)),
    elements=st.sampled_from(VALUES),
)
NARROW_ROWS = hnp.arrays(
    np.uint8, st.tuples(st.integers(1, 20), st.integers(1, 7)), elements=st.integers(0, 2)
)


@given(ROWS)
def test_rows_share_a_number_exactly_where_they_are_equal(rows):
    ids = distinct_rows(rows)
    equal = (rows[:, None] == rows[None]).all(axis=2)
    np.testing.assert_array_equal(ids[:, None] == ids[None], equal)


@given(ROWS)
def test_colliding_hashes_join_nothing(rows):
    collide = module._hash
    module._hash = lambda words: words[:, 0].astype(np.uint64) * 0
    try:
        ids = distinct_rows(rows)
    finally:
        module._hash = collide
    equal = (rows[:, None] == rows[None]).all(axis=2)
    np.testing.assert_array_equal(ids[:, None] == ids[None], equal)


@given(NARROW_ROWS)
def test_rows_of_odd_width_are_compared_whole(rows):
    ids = distinct_rows(rows)
    np.testing.assert_array_equal(ids[:, None] == ids[None], (rows[:, None] == rows).all(axis=2))


@given(st.lists(st.integers(0, 9), max_size=30))
def test_numbers_follow_first_appearance(labels):
    expected = [list(dict.fromkeys(labels)).index(label) for label in labels]
    numbers, first = number_by_first_appearance(np.array(labels, dtype=np.int64))
    assert numbers.tolist() == expected
    assert first.tolist() == [labels.index(label) for label in dict.fromkeys(labels)]
    places = first_places(np.array(labels, dtype=np.int64), 11)
    assert places.tolist() == [labels.index(k) if k in labels else -1 for k in range(11)]
    named = marked(np.array(labels, dtype=np.int64), 11)
    assert named.tolist() == [k in labels for k in range(11)]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_box_is_numpys_own_in_the_points_precision(dtype):
    points = np.random.default_rng(0).normal(size=(1001, 3)).astype(dtype)
    low, high = extent(points)
    for found, expected in ((low, points.min(axis=0)), (high, points.max(axis=0))):
        assert found.dtype == dtype
        np.testing.assert_array_equal(found, expected)
    low, high = extent(points[:1])
    assert low.tolist() == high.tolist() == points[0].tolist()


def test_what_is_no_number_is_seen_in_the_box():
    low, high = extent(np.array([[0.0, 1.0], [np.nan, 2.0]]))
    assert np.isnan([low[0], high[0]]).all()
    assert (low[1], high[1]) == (1, 2)


@given(st.lists(st.tuples(st.integers(1, 9), st.integers(0, 6)), min_size=1, max_size=5))
def test_meshes_side_by_side_keep_their_points_and_share_none(sizes):
    rng = np.random.default_rng(0)
    parts = [(rng.integers(0, vertices, (faces, 3)), vertices) for vertices, faces in sizes]
    points = [rng.normal(size=(vertices, 3)) for vertices, _ in sizes]
    faces = disjoint_faces(parts)
    assert faces.dtype == np.int64
    expected = [own[corners] for own, (corners, _) in zip(points, parts, strict=True)]
    np.testing.assert_array_equal(np.concatenate(points)[faces], np.concatenate(expected))
    owner = np.repeat(np.arange(len(sizes)), [vertices for vertices, _ in sizes])
    assert (owner[faces] == owner[faces[:, :1]]).all()


@pytest.mark.parametrize("narrow", [np.uint8, np.int32])
def test_narrow_indices_do_not_wrap(narrow):
    part = np.array([[0, 1, 2]], dtype=narrow)
    assert disjoint_faces([(part, 2**31), (part, 3)])[1].tolist() == [2**31, 2**31 + 1, 2**31 + 2]


def test_vectors_follow_numpy():
    u, v = np.random.default_rng(0).standard_normal((2, 50, 3))
    np.testing.assert_allclose(dot(u, v), np.sum(u * v, axis=1), atol=1e-14)
    np.testing.assert_array_equal(cross(u, v), np.cross(u, v))
    np.testing.assert_allclose(norm(u), np.linalg.norm(u, axis=1), atol=1e-14)
    np.testing.assert_allclose(norm(unit(u)), 1, atol=1e-15)
    assert unit(np.array([[0.0, 0, 0], [0, -2, 0]])).tolist() == [[0, 0, 0], [0, -1, 0]]
