"""GELU of a number is the exact one to single precision, and exactly x or 0 from 5.6 on."""

import math

import numpy as np
import pytest

from pns_common.fused.kernels.gelu import LIMIT, gelu, gelu_within


@pytest.mark.parametrize("x", np.linspace(-7, 7, 57, dtype=np.float32))
def test_it_is_near_the_exact_one(x):
    exact = float(x) / 2 * (1 + math.erf(float(x) / math.sqrt(2)))
    made = gelu(x, LIMIT)
    assert made.dtype == np.float32
    assert abs(made - exact) <= 2.4e-7 * max(1, abs(x))
    if abs(x) >= LIMIT:
        assert made == max(x, 0)


def test_numbers_and_arrays_have_the_same_bits():
    x = np.random.default_rng(0).uniform(-9, 9, 500).astype(np.float32)
    together = gelu_within(x, np.clip(x, -LIMIT, LIMIT))
    np.testing.assert_array_equal(together, [gelu(each, LIMIT) for each in x])
