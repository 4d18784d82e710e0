"""The box around some points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

# So many points are looked at as one row: down rows of three numbers numpy takes ten times as long.
FOLD = 128


def extent(
    points: Float[np.ndarray, "N K"],
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    """Return the least and the largest of each coordinate of N ≥ 1 points, in their precision."""
    return _reduced(np.min, points), _reduced(np.max, points)


def _reduced(
    by: Callable[..., Float[np.ndarray, "..."]], points: Float[np.ndarray, "N K"]
) -> Float[np.ndarray, " K"]:
    whole = len(points) - len(points) % FOLD
    if whole:
        folded = by(points[:whole].reshape(-1, FOLD * points.shape[1]), axis=0)
        points = np.concatenate([folded.reshape(FOLD, -1), points[whole:]])
    return by(points, axis=0)
