"""The reference length R of a mesh: the unit in which the budget C / R is a curvature."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import marked, norm


def measure_reference_length(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> float:
    """Return R, the largest distance of a referenced vertex from their centroid, over √2.

    About 1 on the paper's patches over [−1, 1]²; unchanged by rotation, proportional to scale.
    """
    referenced = vertices[marked(faces.reshape(-1), len(vertices))]
    return float(norm(referenced - referenced.mean(axis=0)).max()) / math.sqrt(2)
