"""Weights of named columns: the heaviest are kept, and whole units add up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.carry.weights import keep_heaviest, scale_rows, whole_units
from pns_common.parallel import Blocks

BLOCKS = Blocks(threads=2, rows=7)


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_the_heaviest_are_kept_and_what_is_lost_is_counted(seed, slots):
    # Few different weights, so that many are equal.
    columns = np.random.default_rng(seed).choice([0.0, 0.25, 0.5, 1.0], (30, 7))
    names, kept = np.zeros((30, slots), dtype=np.int32), np.zeros((30, slots))
    lost = np.zeros(30)
    for some in ([0, 1, 2], [3], [4, 5, 6]):
        keep_heaviest(columns[:, some], 10 + np.array(some), names, kept, lost, BLOCKS)
    for row, own, weights, less in zip(columns, names, kept, lost, strict=True):
        order = sorted(range(7), key=lambda k: (-row[k], k))
        best = [k for k in order if row[k] > 0][:slots]
        empty = [0] * (slots - len(best))
        assert own.tolist() == [10 + k for k in best] + empty
        assert weights.tolist() == [row[k] for k in best] + empty
        assert less == row.sum() - weights.sum()


@given(st.integers(0, 2**32 - 1), st.integers(1, 20))
def test_rows_are_divided_by_their_sums(seed, width):
    weights = np.random.default_rng(seed).random((10, width))
    expected = weights / weights.sum(axis=1, keepdims=True)
    scale_rows(weights, BLOCKS)
    np.testing.assert_array_equal(weights, expected)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.sampled_from([255, 65535, 2**24]))
def test_whole_units_are_within_one_of_the_weights(seed, width, full):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.full(width, 0.3), 20) * rng.uniform(0.5, 2, (20, 1))
    weights[3] = 0
    units = whole_units(weights, full, BLOCKS)
    assert units.sum(axis=1).tolist() == [full] * 3 + [0] + [full] * 16
    exact = full * weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    assert np.abs(units - exact).max() <= 1
    assert not units[weights == 0].any()


@pytest.mark.parametrize(
    ("weights", "units"),
    [([1, 1, 1], [4, 3, 3]), ([0.26, 0.26, 0.48], [3, 2, 5]), ([2, 6, 2], [2, 6, 2])],
)
def test_largest_remainders_go_up_and_of_equals_the_first(weights, units):
    made = whole_units(np.array([weights], dtype=np.float64), 10, BLOCKS)
    assert made.tolist() == [units]
