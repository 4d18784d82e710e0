"""Angles of kernels, with the bits of ``pns_common.geometry.angles``."""

from __future__ import annotations

import math

from pns_common.geometry.angles import (
    GENTLE,
    HALF_PI,
    LEFT_OF_HALF,
    LEFT_OF_QUARTER,
    P0,
    P1,
    P2,
    P3,
    P4,
    Q0,
    Q1,
    Q2,
    Q3,
    Q4,
    QUARTER_PI,
    STEEP,
)


def angle_between(across, along):
    """Return the angle, 0 … π, of which these are the sine and the cosine but for one factor."""
    size = abs(along)
    gentle, steep = across <= GENTLE * size, across > STEEP * size
    above = across if gentle else -size if steep else across - size
    below = size if gentle else across if steep else across + size
    t = above / (below if below > 0 else 1.0)
    z = t * t
    p = (((P4 * z + P3) * z + P2) * z + P1) * z + P0
    q = ((((z + Q4) * z + Q3) * z + Q2) * z + Q1) * z + Q0
    base = 0.0 if gentle else HALF_PI if steep else QUARTER_PI
    left = 0.0 if gentle else LEFT_OF_HALF if steep else LEFT_OF_QUARTER
    acute = base + (t * (z * p / q) + t + left)
    return math.pi - acute if along < 0 else acute
