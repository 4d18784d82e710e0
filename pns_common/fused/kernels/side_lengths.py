"""Sums over the sides of faces, with the bits of geometry/side_lengths.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    LONG_INDEX,
    LONG_INDICES,
    POINTS,
    POINTS_OUT,
    SIZE,
    kernel,
)
from pns_common.fused.kernels.vectors import between, norm


@kernel(SIZE, POINTS, LONG_INDICES, LONG_INDEX, LONG_INDEX, SIZE, SIZE, POINTS_OUT)
def sum_sides(points, faces, starts, ends, begin, end, sums):
    """Write the sums of lengths and squares of the blocks begin … end − 1.

    ``starts`` and ``ends`` (B,) say which faces a block has; ``sums`` is (B, 2).
    """
    for block in range(begin, end):
        total, squares = 0.0, 0.0
        for f in range(starts[block], ends[block]):
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            sides = between(points, a, b), between(points, b, c), between(points, c, a)
            for side in sides:
                length = norm(side)
                total += length
                squares += length * length
        sums[block, 0], sums[block, 1] = total, squares
    return 0
