"""The box around some points."""

import numpy as np
import pytest

from pns_common.base.extent import extent


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_box_is_numpys_own_in_the_points_precision(dtype):
    points = np.random.default_rng(0).normal(size=(1001, 3)).astype(dtype)
    low, high = extent(points)
    for found, expected in ((low, points.min(axis=0)), (high, points.max(axis=0))):
        assert found.dtype == dtype
        np.testing.assert_array_equal(found, expected)


def test_one_point_is_its_own_box():
    low, high = extent(np.array([[1.0, 2.0, 3.0]]))
    assert low.tolist() == high.tolist() == [1, 2, 3]


def test_what_is_no_number_is_seen():
    low, high = extent(np.array([[0.0, 1.0], [np.nan, 2.0]]))
    assert np.isnan([low[0], high[0]]).all()
    assert (low[1], high[1]) == (1, 2)
