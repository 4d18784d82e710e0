"""What each kernel of shares writes, as it is compiled and as Python."""

import numpy as np
import pytest

from pns_common.fused.kernels import shares as kernels
from tests.support.kernels import WAYS


@pytest.mark.parametrize("way", WAYS)
def test_columns_find_their_slots_or_are_lost(way):
    columns = np.array([[9.0, 9, 9], [3, 5, 3], [0, 1, 0]])
    names, lost = np.array([7, 8, 9], dtype=np.int32), np.zeros(3)
    kept_names, kept = np.zeros((3, 2), dtype=np.int32), np.zeros((3, 2))
    kept_names[1, 0], kept[1, 0] = 6, 3
    WAYS[way](kernels.keep_heaviest)(columns, names, 1, 3, kept_names, kept, lost)
    np.testing.assert_array_equal(kept_names, [[0, 0], [8, 6], [8, 0]])
    np.testing.assert_array_equal(kept, [[0, 0], [5, 3], [1, 0]])
    np.testing.assert_array_equal(lost, [0, 6, 0])


@pytest.mark.parametrize("way", WAYS)
def test_rows_are_scaled(way):
    weights = np.array([[9.0, 9], [1, 3], [0, 0]])
    WAYS[way](kernels.scale_rows)(1, 3, weights)
    np.testing.assert_array_equal(weights, [[9, 9], [0.25, 0.75], [0, 0]])


@pytest.mark.parametrize("way", WAYS)
def test_long_rows_are_added_up_as_numpy_does_it(way):
    rng = np.random.default_rng(0)
    weights = rng.random((40, 20)) * 10.0 ** rng.integers(-9, 9, (40, 20))
    expected = weights / weights.sum(axis=1, keepdims=True)
    WAYS[way](kernels.scale_rows)(0, 40, weights)
    assert weights.tobytes() == expected.tobytes()


@pytest.mark.parametrize("way", WAYS)
def test_weights_become_whole_units(way):
    weights = np.array([[9.0, 9, 9], [1, 1, 1], [0, 0, 0], [0.26, 0.26, 0.48]])
    units, below = np.full((4, 3), -9, dtype=np.int32), np.empty(3)
    WAYS[way](kernels.whole_units)(weights, 10, 1, 4, units, below)
    np.testing.assert_array_equal(units, [[-9] * 3, [4, 3, 3], [0, 0, 0], [3, 2, 5]])
