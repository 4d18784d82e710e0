"""What operators are made of: outlines that take no memory, broadcasting, reductions."""

import numpy as np
import pytest

from pns_common.runtimes.numpy_network.operator import (
    broadcast,
    compared,
    elementwise,
    folded,
    like_the_first,
    outline_of,
    reduction,
    whole_numbers,
)

TALL, WIDE = outline_of((3, 1), float), outline_of((4,), float)
TABLE = np.arange(12.0).reshape(3, 4)


def test_an_outline_has_any_size_and_holds_one_number():
    huge = outline_of((10**6, 10**6), np.float64)
    assert (huge.size, huge.base.size, huge.strides) == (10**12, 1, (0, 0))
    with pytest.raises(ValueError, match="negative"):
        outline_of((-1,), float)


def test_outlines_spread_over_each_other_as_arrays_do():
    for outline, kind in ((broadcast, float), (compared, bool)):
        (made,) = outline([TALL, WIDE], {})
        assert (made.shape, made.dtype) == ((3, 4), kind)
    assert like_the_first([TALL, WIDE], {})[0].shape == (3, 1)
    with pytest.raises(ValueError, match="unpack"):
        broadcast([TALL, outline_of((4,), np.int64)], {})
    with pytest.raises(ValueError, match="shape mismatch"):
        broadcast([WIDE, outline_of((5,), float)], {})


def test_a_function_of_each_value_has_its_attributes_or_their_defaults():
    scaled = elementwise(lambda x, factor: factor * x, factor=2.0)
    assert scaled.compute([TABLE], {})[0].tolist() == (2 * TABLE).tolist()
    assert scaled.compute([TABLE], {"factor": -1.0})[0].tolist() == (-TABLE).tolist()


def test_a_function_of_two_takes_any_number():
    largest = folded(np.maximum)
    assert largest.compute([TABLE], {})[0].tolist() == TABLE.tolist()
    (made,) = largest.compute([TABLE, np.full(4, 5.0), np.full((3, 1), 7.0)], {})
    assert made.tolist() == np.maximum(TABLE, 7).tolist()


@pytest.mark.parametrize(
    ("axes", "attributes", "expected"),
    [
        ([1], {}, TABLE.sum(axis=1, keepdims=True)),
        ([-2], {"keepdims": 0}, TABLE.sum(axis=0)),
        ([], {}, [[66.0]]),
        ([], {"noop_with_empty_axes": 1}, TABLE),
    ],
)
def test_a_reduction_is_over_the_axes_that_are_named(axes, attributes, expected):
    total = reduction(np.sum)
    for inputs, named in (([TABLE, np.array(axes, dtype=int)], {}), ([TABLE], {"axes": axes})):
        (made,) = total.compute(inputs, attributes | named)
        np.testing.assert_array_equal(made, expected)
        (outline,) = total.outline(inputs, attributes | named)
        assert outline.shape == made.shape


def test_whole_numbers_are_an_inputs_before_an_attributes():
    inputs = [TABLE, np.array([[1], [2]]), None]
    assert whole_numbers(inputs, 1, {"axes": [9]}, "axes") == [1, 2]
    assert whole_numbers(inputs, 2, {"axes": [9]}, "axes") == [9]
    assert whole_numbers(inputs, 3, {}, "axes") == []
