"""Rows of a few weights: the heaviest of many, sums of 1, whole units."""

from __future__ import annotations

import math

from pns_common.kernels import f8_1d, f8_2d, i4_1d, i4_2d, inlined, kernel

# Rows of as many numbers and more are added up in eight partial sums, as numpy does.
PARTIAL = 8


@inlined
def _every_eighth(weights, r, begin, stop):
    total = weights[r, begin]
    for k in range(begin + PARTIAL, stop, PARTIAL):
        total += weights[r, k]
    return total


@inlined
def _sum_of_row(weights, r):
    """Return a row's sum in numpy's order; of up to 128 numbers."""
    count, total, first = weights.shape[1], 0.0, 0
    if count >= PARTIAL:
        first = count - count % PARTIAL
        total = (
            (_every_eighth(weights, r, 0, first) + _every_eighth(weights, r, 1, first))
            + (_every_eighth(weights, r, 2, first) + _every_eighth(weights, r, 3, first))
        ) + (
            (_every_eighth(weights, r, 4, first) + _every_eighth(weights, r, 5, first))
            + (_every_eighth(weights, r, 6, first) + _every_eighth(weights, r, 7, first))
        )
    for k in range(first, count):
        total += weights[r, k]
    return total


@kernel
def keep_heaviest(
    columns: f8_2d, names: i4_1d, begin: int, end: int, kept_names: i4_2d, kept: f8_2d, lost: f8_1d
):
    """Put columns of rows begin … end − 1 into their slots (N, K), heaviest first.

    Args:
        columns: (N, C) what is to be put there, where it is more than 0.
        names: (C,) theirs.
        lost: (N,) to which is added what finds no slot.
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


@kernel
def scale_rows(weights: f8_2d, begin: int, end: int):
    """Scale rows begin … end − 1 so that each sums to 1; those without weight stay 0."""
    for r in range(begin, end):
        total = _sum_of_row(weights, r)
        for k in range(weights.shape[1]):
            weights[r, k] /= total if total > 0 else 1.0


@kernel
def whole_units(weights: f8_2d, total_units: int, begin: int, end: int, below: f8_1d, units: i4_2d):
    """Round rows begin … end − 1 to integers that sum to ``total_units``, or to 0 without weight.

    Args:
        below: (K,) scratch, for what rounding down takes from a row.
        units: (N, K), out.
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
            for other in range(count):
                place += below[other] < below[k] or (other < k and below[other] == below[k])
            units[r, k] += place < missing
