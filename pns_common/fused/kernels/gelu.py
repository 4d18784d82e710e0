"""GELU in single precision, one formula for arrays and for kernels.

    x Φ(x) = x/2 (1 + erf(x/√2)),   erf(x/√2) ≈ x P(x²) / Q(x²) for |x| ≤ 5.6

P and Q minimise the largest error, 1.9e-8; no coefficient is negative, so nothing cancels. At 5.6
x P / Q is exactly 1 as it is computed, so that beyond it GELU is x or 0. As computed it lies within
2.4e-7 max(1, |x|) of the exact one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

LIMIT, HALF = np.float32(5.6), np.float32(0.5)
P0, P1, P2 = np.float32(676072.06), np.float32(58254.88), np.float32(7977.129)
P3, P4, P5 = np.float32(294.60455), np.float32(10.771771), np.float32(0.037527803)
# The first coefficient of Q is 1.
Q0, Q1, Q2 = np.float32(847330.75), np.float32(214232.66), np.float32(24521.516)
Q3, Q4 = np.float32(1620.8885), np.float32(63.63315)


def gelu_within(x: Any, limited: Any) -> Any:
    """Return x Φ(x), where ``limited`` is x, or ± LIMIT beyond it."""
    y = limited * limited
    p = ((((P5 * y + P4) * y + P3) * y + P2) * y + P1) * y + P0
    q = ((((y + Q4) * y + Q3) * y + Q2) * y + Q1) * y + Q0
    half = HALF * x
    return half + half * (limited * p / q)


def gelu(x, limit):
    """Return x Φ(x) of a number; NaN of −∞, as x/2 (1 + erf(x/√2)) is.

    ``limit`` is LIMIT. A compiler that knew the number would take four steps for these two.
    """
    above = x if x > -limit else -limit
    return gelu_within(x, above if above < limit else limit)
