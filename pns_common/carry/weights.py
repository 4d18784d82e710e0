"""Weights of named columns, such as a skin's joints: the heaviest of each row, in whole units.

N rows keep K slots each: names, and their weights, heaviest first.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer

from pns_common.kernels import weights as kernels
from pns_common.parallel import Blocks


def keep_heaviest(
    columns: Float[np.ndarray, "N C"],
    names: Integer[np.ndarray, " C"],
    kept_names: Integer[np.ndarray, "N K"],
    kept: Float[np.ndarray, "N K"],
    lost: Float[np.ndarray, " N"],
    blocks: Blocks,
) -> None:
    """Put columns into the slots of each row where they are heavier than what is kept there.

    Of equals, what was there before stays first, then the earlier column. What finds no slot is
    added to ``lost``. An empty slot has the name 0.
    """
    given = np.ascontiguousarray(columns), names.astype(kept_names.dtype)
    to = kept_names, kept, lost
    blocks.run(len(columns), lambda begin, end: kernels.keep_heaviest(*given, begin, end, *to))


def scale_rows(weights: Float[np.ndarray, "N K"], blocks: Blocks) -> None:
    """Scale rows of up to 128 weights in place, so that each sums to 1; rows of 0 stay."""
    blocks.run(len(weights), lambda begin, end: kernels.scale_rows(weights, begin, end))


def whole_units(
    weights: Float[np.ndarray, "N K"], total_units: int, blocks: Blocks
) -> Integer[np.ndarray, "N K"]:
    """Round weights to integers that sum to ``total_units`` a row: largest remainders go up.

    Rows without weight stay 0. Units are below 2³¹.
    """
    weights, units = np.ascontiguousarray(weights), np.empty(weights.shape, dtype=np.int32)

    def write(begin: int, end: int) -> None:
        below = np.empty(weights.shape[1])
        kernels.whole_units(weights, total_units, begin, end, below, units)

    blocks.run(len(weights), write)
    return units
