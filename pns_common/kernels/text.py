"""Numbers as text: as C's printf writes them by %g and %d, to the last digit."""

from __future__ import annotations

from pns_common.kernels import f8_1d, f8_2d, i1_1d, i8_1d, i8_2d, inlined, kernel

# Parts a double into halves whose products are exact (Dekker 1971).
HALVES = 2.0**27 + 1
ZERO, POINT, PLUS, MINUS, EXPONENT = 48, 46, 43, 45, 101


@inlined
def _rest(a, b, product):
    """Return a b − product, exactly, where product is a b rounded."""
    c, d = HALVES * a, HALVES * b
    a1, b1 = c - (c - a), d - (d - b)
    a2, b2 = a - a1, b - b1
    return a2 * b2 - (((product - a1 * b1) - a2 * b1) - a1 * b2)


@inlined
def _rounded(x, power, powers):
    """Return x 10^power, rounded to a whole number, ties to an even one."""
    if power >= 0:
        scaled = x * powers[power]
        m = int(scaled)
        # Above or below a half: the sign of a sum is exact.
        over = (scaled - m - 0.5) + _rest(x, powers[power], scaled)
    else:
        by = powers[-power]
        m = int(x / by)
        product = m * by
        over = (x - product - 0.5 * by) - _rest(float(m), by, product)
    return m + 1 if over > 0 or (over == 0 and m % 2 == 1) else m


@inlined
def _write_whole(number, width, out, at):
    """Write a whole number ≥ 0 with zeros in front up to a width; return where it ends."""
    digits, rest = 1, number // 10
    while rest > 0:
        digits, rest = digits + 1, rest // 10
    end = at + max(digits, width)
    for place in range(end - 1, at - 1, -1):
        out[place] = ZERO + number % 10
        number = number // 10
    return end


@inlined
def _write_number(x, digits, powers, wholes, out, at):
    """Write a number by %.{digits}g; return where it ends."""
    if x < 0:
        out[at] = MINUS
        x, at = -x, at + 1
    if x == 0:
        out[at] = ZERO
        return at + 1
    e = 0
    while x >= powers[e + 1]:
        e += 1
    while e <= 0 and x * powers[-e] < 1:
        e -= 1
    m = _rounded(x, digits - 1 - e, powers)
    if m == wholes[digits]:
        m, e = m // 10, e + 1
    plain = -4 <= e < digits
    width = digits - 1 - e if plain else digits - 1
    whole, fraction = m // wholes[width], m % wholes[width]
    at = _write_whole(whole, 1, out, at)
    if fraction > 0:
        while fraction % 10 == 0:
            fraction, width = fraction // 10, width - 1
        out[at] = POINT
        at = _write_whole(fraction, width, out, at + 1)
    if not plain:
        out[at], out[at + 1] = EXPONENT, MINUS if e < 0 else PLUS
        at = _write_whole(abs(e), 2, out, at + 2)
    return at


@inlined
def _write_part(parts, ends, k, out, at):
    """Write the text before the k-th number of a row, or behind its last; return where it ends."""
    for place in range(ends[k - 1] if k > 0 else 0, ends[k]):
        out[at] = parts[place]
        at += 1
    return at


@kernel
def write_numbers(
    rows: f8_2d,
    digits: int,
    parts: i1_1d,
    ends: i8_1d,
    powers: f8_1d,
    wholes: i8_1d,
    out: i1_1d,
    end: i8_1d,
):
    """Write rows of numbers by %.{digits}g, between parts of text.

    Args:
        rows: (N, K) numbers, 0 or of 1e-10 ≤ |x| < 1e22.
        digits: 1 … 12.
        parts: K + 1 texts, one after the other, of each row.
        ends: (K + 1,) where each of them ends.
        powers, wholes: 10^0, 10^1, …
        out: the text.
        end: (1,) out: where it ends.
    """
    at, width = 0, rows.shape[1]
    for r in range(rows.shape[0]):
        for k in range(width):
            at = _write_part(parts, ends, k, out, at)
            at = _write_number(rows[r, k], digits, powers, wholes, out, at)
        at = _write_part(parts, ends, width, out, at)
    end[0] = at


@kernel
def write_wholes(rows: i8_2d, parts: i1_1d, ends: i8_1d, out: i1_1d, end: i8_1d):
    """Write rows of whole numbers ≥ 0 between parts of text; arguments as of ``write_numbers``."""
    at, width = 0, rows.shape[1]
    for r in range(rows.shape[0]):
        for k in range(width):
            at = _write_part(parts, ends, k, out, at)
            at = _write_whole(rows[r, k], 1, out, at)
        at = _write_part(parts, ends, width, out, at)
    end[0] = at
