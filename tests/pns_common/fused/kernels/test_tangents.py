"""What the kernel of tangents writes, as it is compiled and as Python."""

import numpy as np
import pytest

from pns_common.fused.kernels.tangents import perpendicular_tangents
from tests.support.kernels import WAYS


@pytest.mark.parametrize("way", WAYS)
def test_tangents_are_flattened_or_come_from_the_axis_furthest_from_the_normal(way):
    normals = np.array([[9.0, 9, 9], [0, 0, 1], [0, 0.6, 0.8], [0.8, 0.6, 0], [0.6, 0, 0.8]])
    tangents = np.array([[9.0, 9, 9], [3, 4, 5], [0, 6, 8], [0, 0, 0], [-1.2, 0, -1.6]])
    made = np.full((5, 3), np.nan)
    WAYS[way](perpendicular_tangents)(tangents, normals, 1, 5, made)
    np.testing.assert_allclose(
        made, [[np.nan] * 3, [0.6, 0.8, 0], [1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-15
    )
