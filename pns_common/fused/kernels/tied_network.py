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
    SINGLES_OUT,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.smoothstep import smoothstep

# Rows that are computed together, one beside the other: what they take stays in the first-level
# cache. A number of a row stands LANES after the one before it, whatever the network: so machine
# code knows that those that it reads do not overlap those that it writes.
LANES = 128
NOTHING = np.float32(0)


def _read(features, order, begin, seen):
    """Read rows from ``begin`` on, their features in this order; 0 past the last."""
    present = min(LANES, features.shape[0] - begin)
    for lane in range(present):
        for k in range(len(order)):
            seen[k * LANES + lane] = np.float32(features[begin + lane, order[k]])
    for k in range(len(order)):
        for lane in range(present, LANES):
            seen[k * LANES + lane] = NOTHING


def _start(i):
    """Return where row i begins."""
    return natural(i * LANES)


def _add_and_subtract(x, i, j):
    """Put the sum and the difference of rows i and j of ``x`` in their place."""
    first, second = _start(i), _start(j)
    for lane in range(LANES):
        a, b = x[first + lane], x[second + lane]
        x[first + lane] = a + b
        x[second + lane] = a - b


def _fill(x, i, value):
    to = _start(i)
    for lane in range(LANES):
        x[to + lane] = value


def _put_one(x, i, bias, y, j, weights, at):
    a = weights[at]
    to, first = _start(i), _start(j)
    for lane in range(LANES):
        x[to + lane] = bias + a * y[first + lane]


def _put_two(x, i, bias, y, j, step, weights, at):
    a, b = weights[at], weights[at + 1]
    to, first, second = _start(i), _start(j), _start(j + step)
    for lane in range(LANES):
        total = bias + a * y[first + lane]
        x[to + lane] = total + b * y[second + lane]


def _add_two(x, i, y, j, step, weights, at):
    """Add the products of two rows to what is there, which is read once."""
    a, b = weights[at], weights[at + 1]
    to, first, second = _start(i), _start(j), _start(j + step)
    for lane in range(LANES):
        total = x[to + lane] + a * y[first + lane]
        x[to + lane] = total + b * y[second + lane]


def _add_four(x, i, y, j, step, weights, at):
    """Add those of four rows likewise."""
    a, b, c, d = weights[at], weights[at + 1], weights[at + 2], weights[at + 3]
    to, first, second = _start(i), _start(j), _start(j + step)
    third, fourth = _start(j + 2 * step), _start(j + 3 * step)
    for lane in range(LANES):
        total = x[to + lane] + a * y[first + lane]
        total += b * y[second + lane]
        total += c * y[third + lane]
        x[to + lane] = total + d * y[fourth + lane]


def _weigh(x, i, bias, y, j, step, count, weights, at):
    """Put a bias and the products of rows j, j + step, … of ``y`` into row i, in this order.

    The first one or two with the bias, and then so many that the others are fours.
    """
    if count == 0:
        _fill(x, i, bias)
        return
    if count % 2 == 1:
        done = 1
        _put_one(x, i, bias, y, j, weights, at)
    else:
        done = 2
        _put_two(x, i, bias, y, j, step, weights, at)
    if (count - done) % 4 == 2:
        _add_two(x, i, y, j + done * step, step, weights, at + done)
        done += 2
    while done < count:
        _add_four(x, i, y, j + done * step, step, weights, at + done)
        done += 4


def _two(a, b):
    return a + b, a - b


def _eight(a, b, c, d, e, f, g, h):
    """Return the sums and differences of eight copies by their characters."""
    a, b = _two(a, b)
    c, d = _two(c, d)
    e, f = _two(e, f)
    g, h = _two(g, h)
    a, c = _two(a, c)
    b, d = _two(b, d)
    e, g = _two(e, g)
    f, h = _two(f, h)
    a, e = _two(a, e)
    b, f = _two(b, f)
    c, g = _two(c, g)
    d, h = _two(d, h)
    return a, b, c, d, e, f, g, h


def _activate_eight(units, said, width):
    for i in range(width):
        for lane in range(LANES):
            k = i * 8 * LANES + lane
            a, b, c, d, e, f, g, h = _eight(
                units[k],
                units[k + LANES],
                units[k + 2 * LANES],
                units[k + 3 * LANES],
                units[k + 4 * LANES],
                units[k + 5 * LANES],
                units[k + 6 * LANES],
                units[k + 7 * LANES],
            )
            a, b, c, d = smoothstep(a), smoothstep(b), smoothstep(c), smoothstep(d)
            e, f, g, h = smoothstep(e), smoothstep(f), smoothstep(g), smoothstep(h)
            a, b, c, d, e, f, g, h = _eight(a, b, c, d, e, f, g, h)
            said[k] = a
            said[k + LANES] = b
            said[k + 2 * LANES] = c
            said[k + 3 * LANES] = d
            said[k + 4 * LANES] = e
            said[k + 5 * LANES] = f
            said[k + 6 * LANES] = g
            said[k + 7 * LANES] = h


def _activate_two(units, said, width):
    for i in range(width):
        for lane in range(LANES):
            k = i * 2 * LANES + lane
            a, b = _two(units[k], units[k + LANES])
            a, b = _two(smoothstep(a), smoothstep(b))
            said[k] = a
            said[k + LANES] = b


def _transform(units, copies, width):
    """Put Σ_g χ_s(g) x_g in place of x_s."""
    step = 1
    while step < copies:
        for i in range(width):
            for g in range(copies):
                if g & step == 0:
                    _add_and_subtract(units, i * copies + g, i * copies + g + step)
        step *= 2


def _activate(units, said, copies, width):
    """Write what all copies say, between two transforms."""
    if copies == 8:
        _activate_eight(units, said, width)
    elif copies == 2:
        _activate_two(units, said, width)
    else:
        _transform(units, copies, width)
        for k in range(width * copies * LANES):
            said[k] = smoothstep(units[k])
        _transform(said, copies, width)


def _first(units, seen, copies, width, characters, first, biases):
    """Write the first layer: of each character the features that know it."""
    row = 0
    for s in range(copies):
        begin = row
        while row < len(characters) and characters[row] == s:
            row += 1
        for i in range(width):
            bias, at = biases[i] if s == 0 else NOTHING, i * len(characters) + begin
            _weigh(units, i * copies + s, bias, seen, begin, 1, row - begin, first, at)


def _next(units, said, copies, before, width, hidden, at, biases, bias_at):
    """Write a layer of what the one before it said: a block of products for each character."""
    for s in range(copies):
        for i in range(width):
            bias = biases[bias_at + i] if s == 0 else NOTHING
            _weigh(units, i * copies + s, bias, said, s, copies, before, hidden, at)
            at += before
    return at


def _square(z, lane):
    """Return ‖z‖² in double precision, where no square of a single overflows."""
    x, y = np.float64(z[lane]), np.float64(z[LANES + lane])
    w = np.float64(z[2 * LANES + lane])
    return x * x + y * y + w * w


def _write(z, begin, budget, answers):
    """Write budget · z / max(1, ‖z‖) in double precision."""
    present, at, long = min(LANES, len(answers) // 3 - begin), natural(3 * begin), 0
    for lane in range(LANES):
        long += not _square(z, lane) <= 1
    if long == 0:
        # As in most: no root, and a compiler leaves out what divides by 1.
        for lane in range(present):
            answers[at + 3 * lane] = _scaled(z[lane], 1.0, budget)
            answers[at + 3 * lane + 1] = _scaled(z[LANES + lane], 1.0, budget)
            answers[at + 3 * lane + 2] = _scaled(z[2 * LANES + lane], 1.0, budget)
        return
    for lane in range(present):
        length = math.sqrt(_square(z, lane))
        divisor = length if length > 1 else 1.0
        for c in range(3):
            answers[at + 3 * lane + c] = _scaled(z[c * LANES + lane], divisor, budget)


def _scaled(said, divisor, budget):
    return np.float32(np.float64(said) / divisor * budget)


@kernel(
    SIZE,
    *(POINTS, INDEX, INDICES, INDEX, INTEGERS, SINGLES, SINGLES, SINGLES),
    *(SINGLES, INDEX, SINGLES, SIZE, REAL),
    *(SINGLES_OUT, SINGLES_OUT, SINGLES_OUT, SINGLES_OUT),
)
def answer(
    features,
    order,
    pairs,
    characters,
    widths,
    first,
    hidden,
    biases,
    last,
    last_characters,
    last_bias,
    copies,
    budget,
    seen,
    units,
    said,
    answers,
):
    """Answer all rows of features; the weights are those of ``tied_form.TiedForm``.

    Args:
        last: (3 M,) products of one coordinate after the other.
        seen: LANES for each of the larger of K and 3, overwritten.
        units, said: LANES for each of n M units of the widest layer, likewise: before the
            activation, and after it.
        answers: 3 N out, row by row.
    """
    for begin in range(0, len(features), LANES):
        _read(features, order, begin, seen)
        for pair in range(len(pairs)):
            _add_and_subtract(seen, pairs[pair, 0], pairs[pair, 1])
        width, at, bias_at = widths[0], 0, widths[0]
        _first(units, seen, copies, width, characters, first, biases)
        for layer in range(1, len(widths)):
            _activate(units, said, copies, width)
            before, width = width, widths[layer]
            at = _next(units, said, copies, before, width, hidden, at, biases, bias_at)
            bias_at += width
        _activate(units, said, copies, width)
        for c in range(3):
            s = last_characters[c]
            _weigh(seen, c, last_bias[c], said, s, copies, width, last, c * width)
        _write(seen, begin, budget, answers)
    return 0
