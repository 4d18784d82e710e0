"""Corners are joined across the edges that are named, and across no others."""

import numpy as np
import pytest

from pns_common.fused.kernels.smooth_fans import join_corners
from tests.support.kernels import WAYS

# Three faces (0, 1, 2), (2, 1, 3), (3, 4, 2): half-edges 1 and 3 are one edge, 5 and 8 another.
HALF_EDGES = np.array([[0, -1], [1, 3], [2, -1], [4, -1], [5, 8], [6, -1], [7, -1]], dtype=np.int32)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([], [0, 1, 2, 3, 4, 5, 6, 7, 8]),
        ([1], [0, 1, 2, 2, 1, 3, 4, 5, 6]),
        ([4], [0, 1, 2, 3, 4, 5, 5, 6, 3]),
        ([4, 1], [0, 1, 2, 2, 1, 3, 3, 4, 2]),
    ],
)
def test_fans_are_numbered_as_they_first_appear(rows, expected, way):
    fans = np.full(9, -9, dtype=np.int32)
    count = WAYS[way](join_corners)(HALF_EDGES, np.array(rows, dtype=np.int32), fans)
    np.testing.assert_array_equal(fans, expected)
    assert count == max(expected) + 1
