"""Polygons as triangles, around their first corners."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int


def fans(sizes: Int[np.ndarray, " F"], corners: Int[np.ndarray, " C"]) -> Int[np.ndarray, "T 3"]:
    """Cut polygons into fans around their first corners; fewer than three corners make none."""
    first = np.cumsum(sizes) - sizes
    pieces = np.maximum(sizes - 2, 0)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    first = np.repeat(first, pieces)
    return np.stack([corners[first], corners[first + number + 1], corners[first + number + 2]], 1)
