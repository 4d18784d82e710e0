"""Surfaces that lie too far from the origin for single precision, in which they are written.

A survey's coordinates are millions of metres, where float32 has steps of half a metre: a surface
that was fine, or coarse enough not to show them before it was refined, comes out as stairs.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.rows import dot, extent

# Nearer than so many times its own size a surface is not looked at: its sides would have to be some
# ten thousandths of that.
FAR = 10
# Fewer steps to a side show: half of one is half a degree.
STEPS = 100


def faces_too_far(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], levels: int = 0
) -> int:
    """Count the faces whose longest side has fewer than ``STEPS`` steps of float32.

    They are those of a surface that will be refined so many levels more.
    """
    low, high = (bound.astype(np.float64) for bound in extent(points))
    largest = max(-low.min(), high.max())
    if largest <= FAR * (high - low).max():
        return 0
    longest = np.zeros(len(faces))
    for corner in range(3):
        side = points[faces[:, corner]].astype(np.float64) - points[faces[:, corner - 1]]
        np.maximum(longest, dot(side, side), out=longest)
    shortest = STEPS * float(np.spacing(np.float32(largest))) * 2**levels
    return int((longest < shortest**2).sum()) * 4**levels
