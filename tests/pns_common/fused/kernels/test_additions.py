"""Rows that nothing is added to."""

import numpy as np
import pytest

from pns_common.fused.kernels.additions import clear_rows
from tests.support.kernels import WAYS


@pytest.mark.parametrize("way", WAYS)
def test_some_rows_are_cleared_and_others_left_alone(way):
    values = np.full((6, 3), 4.0), *(np.full(6, 4.0) for _ in range(3))
    WAYS[way](clear_rows)(np.array([5, 1, 3, 0], dtype=np.int32), 1, 3, *values)
    for each in values:
        assert each.reshape(6, -1)[:, 0].tolist() == [4, 0, 4, 0, 4, 4]
        assert set(each.reshape(-1).tolist()) == {0, 4}
