"""Values that only name something, at new vertices and corners: one of their parents' values."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped

from pns_common.schemes import BaseScheme
from pns_common.schemes.matrix import subdivision_matrix

from .steps import Steps

# Sums of weights that differ by rounding are equal.
DIGITS = 12
# The children of a triangle, by its corners a, b, c (0, 1, 2) and edge vertices ab, bc, ca (3 … 5).
CHILDREN = np.array([(0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)])


def vote_at_points(values: Shaped[np.ndarray, "V K"], steps: Steps) -> Shaped[np.ndarray, "W K"]:
    """Let old vertices keep their value; a new one has that of most of its parents.

    Parents vote with the weight that the scheme's mask gives them; of equals, the parent of the
    largest weight wins, and of these that of the lowest number.
    """
    for step in steps.steps:
        masks = subdivision_matrix([step.topology], steps.base)
        new = masks.rows >= len(values)
        row, parent, weight = masks.rows[new], masks.columns[new], masks.weights[new]
        _, which = np.unique(values, axis=0, return_inverse=True)
        candidate = row * np.int64(len(values)) + which.reshape(-1)[parent]
        _, candidate = np.unique(candidate, return_inverse=True)
        votes = np.round(np.bincount(candidate, weight)[candidate], DIGITS)
        order = np.lexsort([parent, -np.round(weight, DIGITS), -votes, row])
        first = np.unique(row[order], return_index=True)[1]
        values = np.concatenate([values, values[parent[order[first]]]])
    return values


def vote_at_corners(
    values: Shaped[np.ndarray, "C K"], base: BaseScheme, levels: int
) -> Shaped[np.ndarray, "D K"]:
    """Vote on values at the corners of faces for those of the children.

    A child at a corner has that corner's value. A triangle's child in the middle has at each of its
    corners that of the corner before.
    """
    if base.polygons:
        return np.repeat(values, 4**levels, axis=0)
    nearest = np.where(CHILDREN < 3, CHILDREN, CHILDREN - 3)
    nearest[:3] = np.arange(3)[:, None]
    for _ in range(levels):
        values = values.reshape(-1, 3, values.shape[-1])[:, nearest.reshape(-1)]
        values = values.reshape(-1, values.shape[-1])
    return values
