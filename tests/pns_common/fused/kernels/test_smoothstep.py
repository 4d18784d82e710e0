"""x S(x) of a number: exact to single precision, exactly 0 or x beyond ± 2, smooth between."""

import numpy as np
import pytest

from pns_common.fused.kernels.smoothstep import END, smoothstep, smoothstep_within


@pytest.mark.parametrize("x", np.linspace(-4, 4, 49, dtype=np.float32))
def test_it_is_near_the_exact_one(x):
    # S is the cubic with S = 0, 1 and S' = 0 at the ends.
    u = min(max((float(x) + 2) / 4, 0.0), 1.0)
    made = smoothstep(x)
    assert made.dtype == np.float32
    assert abs(made - float(x) * u * u * (3 - 2 * u)) <= 1.2e-7 * max(1, abs(x))
    if abs(x) >= END:
        assert made == max(x, 0)


def test_its_derivative_is_continuous_where_the_pieces_meet():
    for end, slope in ((-2.0, 0.0), (2.0, 1.0)):
        steps = np.array([-1e-6, 0, 1e-6]) + end  # in double precision, the same formula
        values = smoothstep_within(steps, np.clip(steps, -2.0, 2.0))
        np.testing.assert_allclose(np.diff(values) / 1e-6, slope, rtol=0, atol=1e-5)


def test_numbers_and_arrays_have_the_same_bits():
    x = np.random.default_rng(0).uniform(-4, 4, 500).astype(np.float32)
    together = smoothstep_within(x, np.clip(x, -END, END))
    np.testing.assert_array_equal(together, [smoothstep(each) for each in x])
