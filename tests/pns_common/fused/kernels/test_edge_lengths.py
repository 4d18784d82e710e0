"""The kernel that measures edges writes the rows that it is given, and no others."""

import numpy as np
import pytest

from pns_common.fused.kernels.edge_lengths import measure_lengths
from tests.support.kernels import WAYS


@pytest.mark.parametrize("way", WAYS)
def test_lengths_of_some_edges(way):
    points = np.array([[0.0, 0, 0], [3, 4, 0], [3, 4, 12], [0, 0, 0]])
    edges = np.array([[0, 1], [1, 2], [0, 2], [0, 3]], dtype=np.int32)
    lengths = np.full(4, -1.0)
    WAYS[way](measure_lengths)(points, edges, 1, 4, lengths)
    assert lengths.tolist() == [-1, 12, 13, 0]
