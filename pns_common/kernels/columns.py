"""Columns of values: middles of edges, and rows in single precision."""

from __future__ import annotations

from pns_common.kernels import f4_2d, f8_2d, i4_1d, i8_1d, i8_2d, kernel, u4_2d


@kernel
def place_middles(values: f8_2d, edges: i8_2d | u4_2d, begin: int, end: int, middles: f8_2d):
    """Write the values at the middles of edges begin … end − 1."""
    for e in range(begin, end):
        a, b = edges[e, 0], edges[e, 1]
        for k in range(values.shape[1]):
            # Halves first: the sum of two may be more than the type holds.
            middles[e, k] = values[a, k] / 2 + values[b, k] / 2


@kernel
def round_rows(values: f8_2d, rows: i4_1d | i8_1d, begin: int, end: int, rounded: f4_2d):
    """Write rows begin … end − 1 of ``rows``, in single precision."""
    for r in range(begin, end):
        for k in range(values.shape[1]):
            rounded[r, k] = values[rows[r], k]
