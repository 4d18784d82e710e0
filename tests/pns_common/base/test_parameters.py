"""What counts as a number: numpy's do; a bool, or what no finite float stands for, does not."""

import numpy as np
import pytest

from pns_common.base.parameters import is_number, is_whole


@pytest.mark.parametrize("value", [0, -1.5, np.float32(2), np.int8(3)])
def test_finite_real_numbers_are_numbers(value):
    assert is_number(value)


@pytest.mark.parametrize("value", [True, np.True_, np.nan, np.inf, "1", None, 1j, [1], 10**400])
def test_nothing_else_is(value):
    assert not is_number(value)


@pytest.mark.parametrize(("value", "whole"), [(3, True), (np.int64(3), True), (3.0, False)])
def test_whole_numbers_are_of_an_integer_type(value, whole):
    assert is_whole(value) is whole
    assert not is_whole(True)
