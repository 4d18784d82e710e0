"""Directions of normals."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import norm, unit
from pns_common.geometry.corner_normals import NO_DIRECTION


def safe_unit(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Scale rows to length 1; the z axis where there is no direction."""
    return np.where((norm(vectors) > NO_DIRECTION)[:, None], unit(vectors), [0.0, 0.0, 1.0])
