"""The reference length R of a mesh: the unit in which the budget C / R is a curvature."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Integer

from pns_common.kernels import children


def measure_reference_length(
    vertices: Float[np.ndarray, "V 3"], corners: Integer[np.ndarray, " H"]
) -> float:
    """Return the largest distance of a referenced vertex from their centroid, over √2.

    It is about 1 on the paper's patches over [−1, 1]², unchanged by rotation, and proportional to
    scale.
    """
    used, total = np.zeros(len(vertices), dtype=bool), np.zeros(3)
    count = children.referenced_sum(vertices, corners, used, total)
    return children.farthest(vertices, used, total / count) / math.sqrt(2)
