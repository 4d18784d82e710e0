"""What a budget allows at vertices, per unit of length."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int


def budgets_per_length(
    budget: float,
    reference_length: float | Float[np.ndarray, " V"],
    vertices: Int[np.ndarray, " N"],
) -> Float[np.ndarray, " N"]:
    """Return C / R at each of some vertices: R is of the whole mesh, or each vertex's own."""
    if isinstance(reference_length, np.ndarray):
        return budget / reference_length[vertices]
    return np.full(len(vertices), budget / reference_length)
