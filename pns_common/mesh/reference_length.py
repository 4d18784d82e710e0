"""The reference length R of a mesh: the unit in which the budget C / R is a curvature."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Integer

from pns_common.mesh.rows import dot, marked


def measure_reference_length(
    vertices: Float[np.ndarray, "V 3"], corners: Integer[np.ndarray, " H"]
) -> float:
    """Return the largest distance of a referenced vertex from their centroid, over √2.

    It is about 1 on the paper's patches over [−1, 1]², unchanged by rotation, and proportional to
    scale.
    """
    used = marked(corners, len(vertices))
    points = vertices if used.all() else vertices[used]
    # Summed in order: sums in pairs have other bits.
    away = points - np.add.accumulate(points)[-1] / len(points)
    return math.sqrt(dot(away, away).max()) / math.sqrt(2)
