"""How a kernel is declared: by the types that it takes, under a name of its own."""

import numpy as np
import pytest

from pns_common.fused.kernels.compiled import (
    INDEX,
    NUMBERS_OUT,
    POINTS,
    ROWS,
    SELDOM,
    SIZE,
    Array,
    Kernel,
    called_seldom,
    kernel,
    natural,
)


def test_an_array_is_taken_as_it_is_or_refused():
    good = np.zeros((2, 3))
    assert POINTS.checked(good) is good
    frozen = np.zeros(3)
    frozen.flags.writeable = False
    for kind, value in (
        (POINTS, np.zeros(3)),
        (POINTS, np.zeros((2, 3), dtype=np.float32)),
        (POINTS, np.zeros((2, 6))[:, ::2]),
        (INDEX, np.zeros(2, dtype=np.int64)),
        (NUMBERS_OUT, frozen),
    ):
        with pytest.raises(TypeError, match="a kernel takes"):
            kind.checked(value)
    assert Array("float64", 1).checked(frozen) is frozen


def test_a_kernel_has_its_functions_words_and_takes_numbers_as_they_are_declared():
    @kernel(SIZE, POINTS, SIZE)
    def counted(points, more):
        """How many."""

    assert isinstance(counted, Kernel)
    assert (counted.name, counted.__doc__) == ("test_compiled.counted", "How many.")
    seen = []
    counted.code = lambda *given: seen.append(given)  # in place of machine code
    counted(np.zeros((1, 3)), np.int8(4))
    ((_, more),) = seen
    assert (type(more), more) == (int, 4)
    with pytest.raises(ValueError, match="zip"):
        counted(np.zeros((1, 3)))


def test_a_kernel_over_rows_checks_once_what_is_given_once():
    @kernel(SIZE, POINTS, SIZE, SIZE, NUMBERS_OUT, SIZE)
    def counted(points, begin, end, sums, more):
        """How many."""

    seen = []
    counted.code = lambda *given: seen.append(given)  # in place of machine code
    points, sums = np.zeros((4, 3)), np.zeros(1)
    over = counted.over(points, ROWS, sums)
    over(slice(0, 2), 3)
    over(slice(2, 4), np.int8(4))
    assert [(begin, end, more) for _, begin, end, _, more in seen] == [(0, 2, 3), (2, 4, 4)]
    assert all(given[0] is points and given[3] is sums for given in seen)
    with pytest.raises(ValueError, match="zip"):
        over(slice(0, 2))
    counted.over(points, ROWS)(slice(0, 2), sums, 5)
    with pytest.raises(TypeError, match="a kernel takes"):
        counted.over(points, ROWS)(slice(0, 2), points, 5)
    for wrong in ((sums, ROWS), (points, ROWS, points)):
        with pytest.raises(TypeError, match="a kernel takes"):
            counted.over(*wrong)
    with pytest.raises(ValueError, match="zip"):
        counted.over(points, ROWS, sums, 5, 6)
    for without in ((), (points, sums), (points, slice(None), sums)):
        with pytest.raises(TypeError, match=r"counted\.over takes ROWS"):
            counted.over(*without)


def test_a_helper_may_be_kept_out_of_loops():
    def helper():
        pass

    assert called_seldom(helper) is helper
    assert getattr(helper, SELDOM)


def test_a_natural_number_is_kept_and_none_is_negative():
    assert [natural(number) for number in (-2, 0, 5)] == [0, 0, 5]
