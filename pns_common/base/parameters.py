"""What counts as a number in an argument."""

from __future__ import annotations

import math
from numbers import Integral, Real


def is_number(value: object) -> bool:
    """Return whether a value is a finite real number, numpy's too (a bool is none)."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def is_whole(value: object) -> bool:
    """Return whether a value is a whole number of an integer type (a bool is none)."""
    return not isinstance(value, bool) and isinstance(value, Integral)
