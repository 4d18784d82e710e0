"""The box around some points."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

# So many points are looked at as one row: down rows of three numbers numpy takes ten times as long.
FOLD = 128


def extent(
    points: Float[np.ndarray, "N K"],
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    """Return the least and the largest of each coordinate of N ≥ 1 points, in their precision."""
    return _reduced(np.minimum, points), _reduced(np.maximum, points)


def _reduced(by: np.ufunc, points: Float[np.ndarray, "N K"]) -> Float[np.ndarray, " K"]:
    whole = len(points) - len(points) % FOLD
    if whole:
        folded = by.reduce(points[:whole].reshape(-1, FOLD * points.shape[1]), axis=0)
        points = np.concatenate([folded.reshape(FOLD, -1), points[whole:]])
    return by.reduce(points, axis=0)
