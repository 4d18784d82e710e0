"""What counts as a number in an argument."""

from __future__ import annotations

import math

import numpy as np


def is_number(value: object) -> bool:
    """Whether a value is a finite real number (a bool is none)."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    return math.isfinite(value)


def is_whole(value: object) -> bool:
    """Whether a value is a whole number of an integer type (a bool is none)."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
