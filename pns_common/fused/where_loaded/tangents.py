"""Tangents at a right angle to normals, by a kernel where they are loaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.fused import kernels_loaded
from pns_common.fused.kernels import tangents as kernels
from pns_common.fused.kernels.compiled import ROWS
from pns_common.geometry import tangents as arrays


def perpendicular_tangents(
    tangents: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"], blocks: Blocks
) -> Float[np.ndarray, "N 3"]:
    """Return what ``pns_common.geometry.tangents`` makes, in a quarter of the time.

    Of finite numbers it is the same bit for bit. The kernels are not loaded for this.
    """
    if not (kernels_loaded() and tangents.dtype == np.float64):
        return arrays.perpendicular_tangents(tangents, normals, blocks)
    made = np.empty(tangents.shape)
    given = [np.ascontiguousarray(part, dtype=np.float64) for part in (tangents, normals)]
    blocks.run(len(made), kernels.perpendicular_tangents.over(*given, ROWS, made))
    return made
