"""Loop's weights of a vertex's neighbours, by its valence."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer


def beta(valence: Integer[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return β_k, the weight of one neighbour in Loop's own cosine formula; 0 for valence 0."""
    k = np.maximum(valence, 1)
    weight = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
    return np.where(valence > 0, weight, 0.0)


def limit_ring_weight(valence: Integer[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return w_k = 1 / (1 + 3 / (8 k β_k)), the ring's weight in the limit mask; 0 for k = 0.

    The limit of a smooth vertex is (1 − w_k) p + w_k (mean of its neighbours).
    """
    ring = valence * beta(valence)
    return ring / (ring + 3 / 8)
