"""The activation x S(x) in single precision, one formula for arrays and for kernels.

    S(x) = ½ + t (3/8 − t²/32),   t = x within [−2, 2]

S is the smoothstep, the cubic that rises from 0 at −2 to 1 at 2; beyond them x S(x) is exactly 0 or
x, and its derivative is continuous everywhere. It is GELU up to 0.052, without a quotient. Swish
has a logistic function in the place of S (Ramachandran et al. 2017), hard swish a straight one
(Howard et al. 2019).
"""

from __future__ import annotations

from typing import Any

import numpy as np

# All of them exact.
END, HALF = np.float32(2), np.float32(1 / 2)
SLOPE, FALL = np.float32(3 / 8), np.float32(1 / 32)


def smoothstep_within(x: Any, limited: Any) -> Any:
    """Return x S(x), where ``limited`` is x, or ± 2 beyond it."""
    return x * (HALF + limited * (SLOPE - FALL * (limited * limited)))


def smoothstep(x):
    """Return x S(x) of a number; NaN of −∞, where S is 0."""
    above = x if x > -END else -END
    return smoothstep_within(x, above if above < END else END)
