"""The reference length of a mesh, with the bits of ``geometry.reference_length``."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.extent import farthest, mark_referenced_long, sum_referenced


def reference_length(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], blocks: Blocks
) -> float:
    """Return R: the largest distance of a referenced vertex from their centroid, over √2."""
    used, total = np.zeros(len(vertices), dtype=bool), np.empty(3)
    blocks.run(len(faces), mark_referenced_long.over(faces, ROWS, used))
    count = sum_referenced(vertices, used, total)
    return farthest(vertices, used, total / count) / math.sqrt(2)
