"""Rows of what a learned level adds."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    INDEX,
    NUMBERS_OUT,
    POINTS_OUT,
    SIZE,
    kernel,
    natural,
)


@kernel(SIZE, INDEX, SIZE, SIZE, POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT)
def clear_rows(rows, begin, end, displacement, ratio, gate, envelope):
    """Write 0 into rows[begin:end] of all."""
    for i in range(natural(begin), end):
        at = rows[i]
        for k in range(3):
            displacement[at, k] = 0.0
        ratio[at] = gate[at] = envelope[at] = 0.0
    return 0
