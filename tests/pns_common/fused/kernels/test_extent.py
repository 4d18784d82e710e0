"""Sums over referenced vertices, and the farthest of them."""

import numpy as np
import pytest

from pns_common.fused.kernels.extent import (
    farthest,
    mark_referenced,
    mark_referenced_long,
    sum_referenced,
)
from tests.support.kernels import WAYS

POINTS = np.array([[3.0, 0, 0], [100, 100, 100], [0, 4, 0], [0, 0, -12]])
FACES = np.array([[0, 2, 3], [3, 2, 0]])
MARKS = {np.int32: mark_referenced, np.int64: mark_referenced_long}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", MARKS)
def test_vertices_of_no_face_do_not_count(way, kind):
    used, total = np.zeros(4, dtype=bool), np.full(3, 9.0)
    WAYS[way](MARKS[kind])(FACES.astype(kind), 0, 1, used)
    assert WAYS[way](sum_referenced)(POINTS, used, total) == 3
    assert used.tolist() == [True, False, True, True]
    assert total.tolist() == [3, 4, -12]
    assert WAYS[way](farthest)(POINTS, used, np.array([0.0, 0, -9])) == np.hypot(9, 4)
    assert WAYS[way](farthest)(POINTS, used, np.array([3.0, 4, 0])) == 13
