"""Sums over the sides of some blocks of faces, and of no others."""

import math

import numpy as np
import pytest

from pns_common.fused.kernels.side_lengths import sum_sides
from tests.support.kernels import WAYS


@pytest.mark.parametrize("way", WAYS)
def test_each_block_is_summed_up_by_itself(way):
    points = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 1], [0, 1, 3], [3, 3, 3]])
    starts, ends = np.array([0, 1, 3]), np.array([1, 3, 4])
    sums = np.full((3, 2), np.nan)
    WAYS[way](sum_sides)(points, faces, starts, ends, 0, 2, sums)
    assert sums[0].tolist() == [12, 50]
    assert sums[1] == pytest.approx([12 + 4 + math.sqrt(10), 50 + 9 + 10 + 1])
    assert np.isnan(sums[2]).all()
    WAYS[way](sum_sides)(points, faces, starts, ends, 2, 3, sums)
    assert sums[2].tolist() == [0, 0]
