"""Numbers of text files are written to the last digit as C's printf writes them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.meshfiles.text import rows_text

FORMS = ["%.12g %.12g\n", "v %.7g/%.7g\n"]


def by_printf(form, rows):
    return b"".join((form % tuple(row)).encode() for row in (rows + 0).tolist())


@pytest.mark.parametrize("form", FORMS)
@given(numbers=st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=40))
def test_any_number(form, numbers):
    rows = np.array(numbers)[:, None].repeat(2, axis=1)
    assert b"".join(rows_text(form, rows)) == by_printf(form, rows)


@pytest.mark.parametrize("form", FORMS)
def test_numbers_of_all_sizes_ties_and_what_rounds_to_a_power_of_ten(form):
    random = np.random.default_rng(7)
    exponents = random.integers(-11, 22, 20_000)
    mantissas = random.uniform(1, 10, 20_000)
    powers = 10.0 ** np.arange(-11, 22)
    # Halves of the last of 12 and of 7 digits, which doubles hold exactly.
    ties = np.concatenate(
        [random.integers(10**11, 10**12, 500) + 0.5, np.arange(1e6, 1e6 + 99, 0.5)]
    )
    numbers = np.concatenate(
        [
            mantissas * 10.0**exponents,
            np.round(mantissas, 3),
            mantissas.astype(np.float32),
            powers,
            np.nextafter(powers, 0),
            np.nextafter(powers, np.inf),
            powers * (1 - 1e-13),
            powers * (1 - 5e-8),
            ties,
            [0.0, -0.0, 1e-4, 1e-5, 99999.99999995, 123456789012.5],
        ]
    )
    rows = np.concatenate([numbers, -numbers])
    # Of a block that has others all are written by printf itself.
    rows = rows[(rows == 0) | (np.abs(rows) >= 1e-10)][:, None].repeat(2, axis=1)
    assert b"".join(rows_text(form, rows)) == by_printf(form, rows)


@given(numbers=st.lists(st.integers(-3, 2**40), min_size=1, max_size=40))
def test_any_whole_number(numbers):
    rows = np.array(numbers)[:, None].repeat(3, axis=1)
    form = "f %d//%d %d\n"
    assert b"".join(rows_text(form, rows)) == by_printf(form, rows)
