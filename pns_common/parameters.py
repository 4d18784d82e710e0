"""Check that an argument is a number, or yes or no."""

from __future__ import annotations

import math
import sys
from numbers import Integral, Real

import numpy as np


def is_number(value: object) -> bool:
    """Return whether a value is a finite real number, numpy's too (a bool is none)."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def is_bool(value: object) -> bool:
    """Return whether a value is True or False, numpy's too."""
    return isinstance(value, bool | np.bool_)


def is_masked(values: object) -> bool:
    """Return whether an array hides some of its values; numpy would read what lies under the mask.

    Where numpy's module of such arrays is not loaded, there is none.
    """
    masked = sys.modules.get("numpy.ma")
    return masked is not None and masked.is_masked(values)


def is_whole(value: object) -> bool:
    """Return whether a value is a whole number of an integer type (a bool is none)."""
    return not isinstance(value, bool) and isinstance(value, Integral)
