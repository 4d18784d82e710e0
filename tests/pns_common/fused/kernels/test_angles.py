"""What the kernel of angles writes, as it is compiled and as Python."""

import numpy as np
import pytest

from pns_common.fused.kernels import angles as kernels
from pns_common.geometry.angles import angle_between
from tests.support.kernels import WAYS


@pytest.mark.parametrize("way", WAYS)
def test_angles_have_the_bits_of_the_arrays_from_a_column_on(way):
    rng = np.random.default_rng(0)
    sides = rng.standard_normal((3, 300)) * 10.0 ** rng.integers(-9, 9, (3, 300))
    sides[0] = np.abs(sides[0])
    sides[:, :4] = [[0.0, 0, 0, 1], [0, -0.0, 1, 0], [-1, 1, 0, 2]]
    made = np.full((2, 302), -9.0)
    WAYS[way](kernels.corner_angles)(sides, 2, made)
    assert made[:, 2:].tobytes() == angle_between(sides[:1], sides[1:]).tobytes()
    assert (made[:, :2] == -9).all()
