"""Gates are hyperbolic tangents, also where these are not evaluated."""

import numpy as np
import pytest
import torch

from pns_common.formula.gate import SATURATED, gate_of


@pytest.mark.parametrize("above", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("count", [0, 1, 63, 1000])
def test_gates_are_the_tangents_bit_by_bit_however_many_are_open(count, above):
    rng = np.random.default_rng(count)
    values = 10.0 ** rng.uniform(-12, 1, count)
    values[rng.random(count) < above] *= 1e12
    np.testing.assert_array_equal(gate_of(values), np.tanh(values))


def test_what_is_not_evaluated_is_one_to_the_last_bit():
    values = np.r_[np.geomspace(SATURATED, 1e308, 10_000), np.inf]
    assert (np.tanh(values) == 1).all()
    assert 2 * np.exp(-2 * SATURATED) < np.finfo(np.float64).epsneg / 2 / 100


def test_what_is_no_number_is_told():
    assert np.isnan(gate_of(np.r_[np.nan, np.full(9, 1e3)])).tolist() == [True] + [False] * 9


def test_tensors_keep_a_gradient():
    values = torch.tensor([0.5, 30.0], dtype=torch.float64, requires_grad=True)
    gate_of(values).sum().backward()
    assert values.grad is not None
    assert values.grad[0] == pytest.approx(1 - np.tanh(0.5) ** 2)
