"""Shares of named columns, by kernels where they are loaded.

Each function gives what that of ``pns_common.masks.shares`` does, ``lost`` to rounding and all else
bit for bit. The kernels are not loaded for this.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused import kernels_loaded
from pns_common.fused.kernels import shares as kernels
from pns_common.fused.kernels.compiled import ROWS
from pns_common.masks import shares as arrays

# Rows that numpy sums up in one go.
WIDEST = 128


def keep_heaviest(
    columns: Float[np.ndarray, "N C"],
    names: Int[np.ndarray, " C"],
    kept_names: Int[np.ndarray, "N K"],
    kept: Float[np.ndarray, "N K"],
    lost: Float[np.ndarray, " N"],
    blocks: Blocks,
) -> None:
    """Put columns into the slots of each row where they are heavier than what is kept there."""
    if not (kernels_loaded() and kept_names.dtype == np.int32):
        arrays.keep_heaviest(columns, names, kept_names, kept, lost, blocks)
        return
    given, to = (np.ascontiguousarray(columns), names.astype(np.int32)), (kept_names, kept, lost)
    blocks.run(len(kept), kernels.keep_heaviest.over(*given, ROWS, *to))


def scale_rows(weights: Float[np.ndarray, "N K"], blocks: Blocks) -> None:
    """Scale rows, in their place, so that each sums to 1; those without weight stay 0."""
    if not (kernels_loaded() and weights.shape[1] <= WIDEST):
        arrays.scale_rows(weights, blocks)
        return
    blocks.run(len(weights), kernels.scale_rows.over(ROWS, weights))


def whole_units(
    weights: Float[np.ndarray, "N K"], total_units: int, blocks: Blocks
) -> Int[np.ndarray, "N K"]:
    """Round weights to integers that sum to ``total_units`` a row: largest remainders go up."""
    if not (kernels_loaded() and weights.shape[1] <= WIDEST):
        return arrays.whole_units(weights, total_units, blocks)
    weights = np.ascontiguousarray(weights)
    units = np.empty(weights.shape, dtype=np.int32)

    write = kernels.whole_units.over(weights, total_units, ROWS, units)
    blocks.run(len(weights), lambda rows: write(rows, np.empty(weights.shape[1])))
    return units
