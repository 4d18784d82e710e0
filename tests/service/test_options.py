"""Options are valid once constructed."""

import math

import pytest

from service.errors import InvalidParameter
from service.options import Options

WRONG = [
    ("levels", 0),
    ("levels", 7),
    ("levels", -1),
    ("scheme", "butterfly"),
    ("diagnostics", "some"),
    ("budget", -0.1),
    ("budget", math.nan),
    ("budget", math.inf),
    ("reference_length", 0.0),
    ("reference_length", -1.0),
    ("reference_length", math.nan),
    ("reference_length", math.inf),
]


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_a_value_outside_its_range_is_refused_by_name(name, value):
    with pytest.raises(InvalidParameter) as refusal:
        Options(**{name: value})
    assert refusal.value.name == name
    assert refusal.value.status == 422


@pytest.mark.parametrize("options", [{}, {"levels": 6}, {"budget": 0.0, "reference_length": 1.0}])
def test_values_in_range_are_taken(options):
    assert all(getattr(Options(**options), name) == value for name, value in options.items())
