"""Numbers of text files are written to the last digit as C's printf writes them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.meshfiles.text import rows_text

FORMS = ["%.12g %.12g\n", "v %.7g/%.7g\n"]


def assert_as_printf(form, numbers, width=2):
    rows = np.array(numbers)[:, None].repeat(width, axis=1)
    expected = b"".join((form % tuple(row)).encode() for row in (rows + 0).tolist())
    assert b"".join(rows_text(form, rows)) == expected


@pytest.mark.parametrize("form", FORMS)
@given(numbers=st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=40))
def test_any_number(form, numbers):
    assert_as_printf(form, numbers)


@given(numbers=st.lists(st.integers(-3, 2**40), min_size=1, max_size=40))
def test_any_whole_number(numbers):
    assert_as_printf("f %d//%d %d\n", numbers, 3)


@pytest.mark.parametrize("form", FORMS)
def test_numbers_of_all_sizes_ties_and_what_rounds_to_a_power_of_ten(form):
    random = np.random.default_rng(7)
    mantissas, powers = random.uniform(1, 10, 20_000), 10.0 ** np.arange(-11, 22)
    # Halves of the last of 12 and of 7 digits, which doubles hold exactly.
    ties = random.integers(10**11, 10**12, 500) + 0.5, np.arange(1e6, 1e6 + 99, 0.5)
    near = [powers * (1 - off) for off in (0, 1e-13, 5e-8)]
    near += [np.nextafter(powers, end) for end in (0, np.inf)]
    sizes = mantissas * 10.0 ** random.integers(-11, 22, 20_000)
    others = [0.0, -0.0, 1e-4, 1e-5, 99999.99999995, 123456789012.5]
    rounded = np.round(mantissas, 3), mantissas.astype(np.float32)
    numbers = np.concatenate([sizes, *rounded, *near, *ties, others])
    numbers = np.concatenate([numbers, -numbers])
    # Of a block that has others all are written by printf itself.
    assert_as_printf(form, numbers[(numbers == 0) | (np.abs(numbers) >= 1e-10)])
