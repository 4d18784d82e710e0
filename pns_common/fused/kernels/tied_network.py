"""A tied network, many rows side by side, with the bits of tied_network/arrays.py."""

from __future__ import annotations

import math

import numpy as np

from pns_common.fused.kernels.compiled import (
    INDEX,
    INDICES,
    INTEGERS,
    POINTS,
    REAL,
    SINGLES,
    SINGLES_2,
    SINGLES_2_OUT,
    SINGLES_3_OUT,
    SIZE,
    kernel,
)
from pns_common.fused.kernels.gelu import gelu

# Rows that are computed together: what they take stays in the first-level cache.
LANES = 128
# What is held beside the units: features, and what the layer before said.
SEEN, SAID = 0, 1
NOTHING = np.float32(0)


def _read(features, begin, held):
    """Read rows from ``begin`` on, one beside the other; 0 past the last."""
    present = min(LANES, features.shape[0] - begin)
    for k in range(features.shape[1]):
        for lane in range(present):
            held[SEEN, k, lane] = np.float32(features[begin + lane, k])
        for lane in range(present, LANES):
            held[SEEN, k, lane] = NOTHING


def _add_and_subtract(x, g, i, h, j):
    """Put the sum and the difference of two rows in their place."""
    for lane in range(LANES):
        a, b = x[g, i, lane], x[h, j, lane]
        x[g, i, lane] = a + b
        x[h, j, lane] = a - b


def _fill(x, g, i, value):
    for lane in range(LANES):
        x[g, i, lane] = value


def _add_product(x, g, i, weight, y, h, j):
    for lane in range(LANES):
        x[g, i, lane] += weight * y[h, j, lane]


def _add_two_products(x, g, i, weight, next_weight, y, h, j):
    """Add those of two rows, one after the other: what they are added to is read and kept once."""
    for lane in range(LANES):
        sum_so_far = x[g, i, lane] + weight * y[h, j, lane]
        x[g, i, lane] = sum_so_far + next_weight * y[h, j + 1, lane]


def _transform(units, width):
    """Put Σ_g χ_s(g) x_g in place of x_s."""
    step = 1
    while step < units.shape[0]:
        for g in range(units.shape[0]):
            if g & step == 0:
                for i in range(width):
                    _add_and_subtract(units, g, i, g + step, i)
        step *= 2


def _activate(units, width):
    """Apply GELU to all copies, between two transforms."""
    _transform(units, width)
    for g in range(units.shape[0]):
        for i in range(width):
            for lane in range(LANES):
                units[g, i, lane] = gelu(units[g, i, lane])
    _transform(units, width)


def _first(units, held, width, characters, first, biases):
    for s in range(units.shape[0]):
        for i in range(width):
            _fill(units, s, i, biases[i] if s == 0 else NOTHING)
    for k in range(len(characters)):
        for i in range(width):
            _add_product(units, characters[k], i, first[k, i], held, SEEN, k)


def _next(units, held, before, width, hidden, at, biases, bias_at):
    """Put a layer in place of the one before it: a block of products for each character."""
    for s in range(units.shape[0]):
        for j in range(before):
            for lane in range(LANES):
                held[SAID, j, lane] = units[s, j, lane]
        for i in range(width):
            _fill(units, s, i, biases[bias_at + i] if s == 0 else NOTHING)
            for j in range(0, before - 1, 2):
                _add_two_products(units, s, i, hidden[at], hidden[at + 1], held, SAID, j)
                at += 2
            if before % 2 == 1:
                _add_product(units, s, i, hidden[at], held, SAID, before - 1)
                at += 1
    return at


def _square(held, lane):
    """Return ‖z‖² in double precision, where no square of a single overflows."""
    x = np.float64(held[SEEN, 0, lane])
    y = np.float64(held[SEEN, 1, lane])
    z = np.float64(held[SEEN, 2, lane])
    return x * x + y * y + z * z


def _write(held, begin, budget, answers):
    """Write budget · z / max(1, ‖z‖) in double precision."""
    present, long = min(LANES, len(answers) - begin), 0
    for lane in range(LANES):
        long += not _square(held, lane) <= 1
    if long == 0:
        # As in most: neither a root nor a division.
        for lane in range(present):
            for c in range(3):
                answers[begin + lane, c] = np.float32(np.float64(held[SEEN, c, lane]) * budget)
        return
    for lane in range(present):
        length = math.sqrt(_square(held, lane))
        divisor = length if length > 1 else 1.0
        for c in range(3):
            z = np.float64(held[SEEN, c, lane])
            answers[begin + lane, c] = np.float32(z / divisor * budget)


@kernel(
    SIZE,
    *(POINTS, INDICES, INDEX, INTEGERS, SINGLES_2, SINGLES, SINGLES),
    *(SINGLES_2, INDEX, SINGLES, REAL, SINGLES_3_OUT, SINGLES_3_OUT, SINGLES_2_OUT),
)
def answer(
    features,
    pairs,
    characters,
    widths,
    first,
    hidden,
    biases,
    last,
    last_characters,
    last_bias,
    budget,
    units,
    held,
    answers,
):
    """Answer all rows of features; the weights are those of ``form.TiedForm``.

    Args:
        units: (n, M, LANES) for the widest M layer, overwritten.
        held: (2, the larger of K and M, LANES), likewise.
        answers: (N, 3) out.
    """
    for begin in range(0, len(features), LANES):
        _read(features, begin, held)
        for pair in range(len(pairs)):
            _add_and_subtract(held, SEEN, pairs[pair, 0], SEEN, pairs[pair, 1])
        width, at, bias_at = widths[0], 0, widths[0]
        _first(units, held, width, characters, first, biases)
        for layer in range(1, len(widths)):
            _activate(units, width)
            at = _next(units, held, width, widths[layer], hidden, at, biases, bias_at)
            width = widths[layer]
            bias_at += width
        _activate(units, width)
        for c in range(3):
            _fill(held, SEEN, c, last_bias[c])
            for i in range(width):
                _add_product(held, SEEN, c, last[c, i], units, last_characters[c], i)
        _write(held, begin, budget, answers)
    return 0
