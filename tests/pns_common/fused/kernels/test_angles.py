"""The angle of a kernel, as plain Python; compiled it is part of test_corner_normals.py."""

import numpy as np

from pns_common.fused.kernels import angles as kernels
from pns_common.geometry.angles import angle_between


def test_angles_have_the_bits_of_the_arrays():
    rng = np.random.default_rng(0)
    across, along = rng.standard_normal((2, 300)) * 10.0 ** rng.integers(-9, 9, (2, 300))
    across = np.abs(across)
    across[:5], along[:5] = [0, 0, 0, 0, 1], [2, -2, 0, -0.0, 0]
    made = np.array([kernels.angle_between(*pair) for pair in zip(across, along, strict=True)])
    assert made.tobytes() == angle_between(across, along).tobytes()
