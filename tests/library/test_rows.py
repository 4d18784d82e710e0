"""Rows that are equal share a number; numbers follow first appearance; boxes are numpy's own."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pns_common.mesh import rows as module
from pns_common.mesh.rows import (
    distinct_rows,
    first_places,
    marked,
    number_by_first_appearance,
)

# Values whose sums and bits are easy to confuse.
VALUES = np.array([0, 1, 2, 1e-45, 3e38], dtype=np.float32).tolist()
ROWS = hnp.arrays(
    np.float32,
    st.tuples(st.integers(1, 40), st.integers(1, 5)),
    elements=st.sampled_from(VALUES),
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
