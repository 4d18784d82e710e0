"""Shares of named columns, with the bits of ``pns_common.masks.shares``.

Each row has few slots: what comes is put in its place among them, where numpy sorts whole rows.
"""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    INDEX,
    INDICES_OUT,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    SIZE,
    kernel,
)

# Numpy adds up so many partial sums where there are as many numbers.
PARTIAL = 8


def _sum_of_row(weights, r):
    """Return a row's sum in numpy's order; of up to 128 numbers."""
    count, total, first = weights.shape[1], 0.0, 0
    if count >= PARTIAL:
        first = count - count % PARTIAL
        total = _sum_of_eighths(weights, r, first)
    for k in range(first, count):
        total += weights[r, k]
    return total


def _sum_of_eighths(weights, r, stop):
    return (
        (_every_eighth(weights, r, 0, stop) + _every_eighth(weights, r, 1, stop))
        + (_every_eighth(weights, r, 2, stop) + _every_eighth(weights, r, 3, stop))
    ) + (
        (_every_eighth(weights, r, 4, stop) + _every_eighth(weights, r, 5, stop))
        + (_every_eighth(weights, r, 6, stop) + _every_eighth(weights, r, 7, stop))
    )


def _every_eighth(weights, r, begin, stop):
    total = weights[r, begin]
    for k in range(begin + PARTIAL, stop, PARTIAL):
        total += weights[r, k]
    return total


@kernel(SIZE, POINTS, INDEX, SIZE, SIZE, INDICES_OUT, POINTS_OUT, NUMBERS_OUT)
def keep_heaviest(columns, names, begin, end, kept_names, kept, lost):
    """Put columns of rows begin … end − 1 into their slots (N, K), heaviest first.

    Args:
        columns: (N, C) what is to be put there, where it is more than 0.
        names: (C,) theirs.
        lost: (N,) to which that is added that finds no slot.
    """
    last = kept.shape[1] - 1
    for r in range(begin, end):
        for k in range(columns.shape[1]):
            weight = columns[r, k]
            # Most rows have nothing of most columns.
            if not weight > 0:
                continue
            if weight > kept[r, last]:
                lost[r] += kept[r, last]
                slot = last
                while slot > 0 and weight > kept[r, slot - 1]:
                    kept[r, slot] = kept[r, slot - 1]
                    kept_names[r, slot] = kept_names[r, slot - 1]
                    slot -= 1
                kept[r, slot], kept_names[r, slot] = weight, names[k]
            else:
                lost[r] += weight
    return 0


@kernel(SIZE, SIZE, SIZE, POINTS_OUT)
def scale_rows(begin, end, weights):
    """Scale rows begin … end − 1 so that each sums to 1; those without weight stay."""
    for r in range(begin, end):
        total = _sum_of_row(weights, r)
        total = total if total > 0 else 1.0
        for k in range(weights.shape[1]):
            weights[r, k] /= total
    return 0


@kernel(SIZE, POINTS, SIZE, SIZE, SIZE, INDICES_OUT, NUMBERS_OUT)
def whole_units(weights, total_units, begin, end, units, below):
    """Round rows begin … end − 1 to integers that sum to ``total_units``, or to 0 without weight.

    Args:
        units: (N, K), out.
        below: (K,) for what rounding down takes from a row.
    """
    count = weights.shape[1]
    for r in range(begin, end):
        total = _sum_of_row(weights, r)
        missing = total_units if total > 0 else 0
        for k in range(count):
            exact = total_units * weights[r, k] / (total if total > 0 else 1.0)
            down = math.floor(exact)
            below[k], units[r, k] = down - exact, down
            missing -= down
        for k in range(count):
            place = 0
            for other in range(k):
                place += below[other] <= below[k]
            for other in range(k + 1, count):
                place += below[other] < below[k]
            units[r, k] += place < missing
    return 0
