"""Rows of values: those in the middles of edges, and some in single precision."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Integer, Real

from pns_common.kernels import columns as kernels
from pns_common.parallel import Blocks


def place_middles(
    values: Float[np.ndarray, "V K"],
    edges: Integer[np.ndarray, "E 2"],
    middles: Float[np.ndarray, "E K"],
    blocks: Blocks,
) -> None:
    """Write the values at the middles of edges."""
    given = np.ascontiguousarray(values), np.ascontiguousarray(edges)

    def place(begin: int, end: int) -> None:
        kernels.place_middles(*given, begin, end, middles)

    blocks.run(len(edges), place)


def rounded_rows(
    values: Real[np.ndarray, "V K"], rows: Integer[np.ndarray, " N"], blocks: Blocks
) -> Float32[np.ndarray, "N K"]:
    """Return rows of values in single precision."""
    rounded = np.empty((len(rows), values.shape[1]), dtype=np.float32)
    given = np.ascontiguousarray(values), np.ascontiguousarray(rows)

    def write(begin: int, end: int) -> None:
        kernels.round_rows(*given, begin, end, rounded)

    blocks.run(len(rows), write)
    return rounded
