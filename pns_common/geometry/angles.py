"""Angles by products, sums and quotients alone: the same bits on any processor.

Arctangents of numpy and of C differ from one processor to the next. After Cephes (Moshier 1989):

    arctan t ≈ t + t z P(z) / Q(z),   z = t²,   for |t| ≤ 0.66

Steeper ones are taken from π/4 or π/2. The relative error is below 2⁻⁵¹.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

HALF_PI, QUARTER_PI = math.pi / 2, math.pi / 4
# What π/2 and π/4 as numbers leave out.
LEFT_OF_HALF, LEFT_OF_QUARTER = 6.123233995736766e-17, 3.061616997868383e-17
# Up to the first, tangents count from 0; beyond the second, which is tan 3π/8, from π/2.
GENTLE, STEEP = 0.66, 2.414213562373095
P0, P1, P2 = -6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1
P3, P4 = -1.615753718733365076637e1, -8.750608600031904122785e-1
# The first coefficient of Q is 1.
Q0, Q1, Q2 = 1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2
Q3, Q4 = 1.650270098316988542046e2, 2.485846490142306297962e1


def angle_between(
    across: Float[np.ndarray, "..."], along: Float[np.ndarray, "..."]
) -> Float[np.ndarray, "..."]:
    """Return the angle, 0 … π, of which these are the sine and the cosine but for one factor.

    ``across`` is 0 or more; the angle is 0 or π where it is 0, and 0 where both are.
    """
    size = np.abs(along)
    gentle, steep = across <= GENTLE * size, across > STEEP * size
    above = np.where(gentle, across, np.where(steep, -size, across - size))
    below = np.where(gentle, size, np.where(steep, across, across + size))
    t = above / np.where(below > 0, below, 1.0)
    z = t * t
    p = (((P4 * z + P3) * z + P2) * z + P1) * z + P0
    q = ((((z + Q4) * z + Q3) * z + Q2) * z + Q1) * z + Q0
    base = np.where(gentle, 0.0, np.where(steep, HALF_PI, QUARTER_PI))
    left = np.where(gentle, 0.0, np.where(steep, LEFT_OF_HALF, LEFT_OF_QUARTER))
    acute = base + (t * (z * p / q) + t + left)
    return np.where(along < 0, math.pi - acute, acute)
