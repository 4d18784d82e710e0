"""Sums over referenced vertices, and the farthest of them."""

import numpy as np
import pytest

from pns_common.fused.kernels.extent import farthest, mark_referenced, sum_referenced
from tests.support.kernels import WAYS

POINTS = np.array([[3.0, 0, 0], [100, 100, 100], [0, 4, 0], [0, 0, -12]])
FACES = np.array([[0, 2, 3], [3, 2, 0]])


@pytest.mark.parametrize("way", WAYS)
def test_vertices_of_no_face_do_not_count(way):
    used, total = np.zeros(4, dtype=bool), np.full(3, 9.0)
    WAYS[way](mark_referenced)(FACES, 0, 1, used)
    assert WAYS[way](sum_referenced)(POINTS, used, total) == 3
    assert used.tolist() == [True, False, True, True]
    assert total.tolist() == [3, 4, -12]
    assert WAYS[way](farthest)(POINTS, used, np.array([0.0, 0, -9])) == np.hypot(9, 4)
    assert WAYS[way](farthest)(POINTS, used, np.array([3.0, 4, 0])) == 13
