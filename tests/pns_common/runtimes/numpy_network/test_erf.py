"""The error function against the C library's."""

import math

import numpy as np

from pns_common.runtimes.numpy_network.erf import CHUNK, LARGE, SMALL, erf


def test_erf_is_the_c_librarys():
    x = np.concatenate([np.linspace(-7, 7, 40_001), [SMALL, LARGE, -LARGE, 1e-300, -0.0, 1e300]])
    exact = np.array([math.erf(value) for value in x])
    assert np.abs(erf(x) - exact).max() <= 1e-15


def test_erf_of_what_is_no_ordinary_number():
    assert erf(np.array([np.inf, -np.inf])).tolist() == [1, -1]
    assert np.isnan(erf(np.array([np.nan]))).all()
    assert np.signbit(erf(np.array([-0.0]))).all()


def test_erf_keeps_the_shape_and_a_values_bits_whatever_is_beside_it():
    x = np.random.default_rng(0).normal(0, 3, (3, CHUNK // 2, 2))
    assert erf(x).shape == x.shape
    np.testing.assert_array_equal(erf(x[:, 5:9, 1]), erf(x)[:, 5:9, 1])
    assert erf(np.array(0.5)).shape == ()
