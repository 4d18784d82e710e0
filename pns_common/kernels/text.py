"""Numbers as text: as C's printf writes them by %g and %d, to the last digit."""

from __future__ import annotations

import numpy as np

from pns_common.kernels import f8_1d, f8_2d, i1_1d, i8_1d, i8_2d, inlined, kernel

# Parts a double into halves whose products are exact (Dekker 1971).
HALVES = 2.0**27 + 1
ZERO, POINT, PLUS, MINUS, EXPONENT = 48, 46, 43, 45, 101
BLANK, SLASH, LINE_END, FACE = 32, 47, 10, 102
# What is written here: others are few.
SMALLEST, LARGEST = 1e-10, 1e22
# Without a sign, division by a constant is a product.
TEN, MILLION = np.uint64(10), np.uint64(10**6)


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
def _write_digits(rest, count, out, end):
    """Write the last digits of a number before ``end``, with zeros in front."""
    for place in range(end - 1, end - count - 1, -1):
        tens = rest // TEN
        out[place] = np.int8(ZERO + (rest - tens * TEN))
        rest = tens


@inlined
def _write_whole(number, out, at):
    """Write a whole number ≥ 0; return where it ends."""
    rest, end, power = np.uint64(number), at + 1, TEN
    while rest >= power:
        end, power = end + 1, power * TEN
    place = end - 1
    while place > at:
        tens = rest // TEN
        out[place] = np.int8(ZERO + (rest - tens * TEN))
        rest, place = tens, place - 1
    out[at] = np.int8(ZERO + rest)
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
    # Digits stand where those of a fraction do; those before a point move up.
    start = at + 1 - e if plain and e < 0 else at + 1
    end = start + digits
    high = np.uint64(m) // MILLION
    _write_digits(np.uint64(m) - high * MILLION, 6, out, end)
    _write_digits(high, digits - 6, out, end - 6)
    while out[end - 1] == ZERO:
        end -= 1
    point = at + 1
    if plain and e < 0:
        for place in range(at, start):
            out[place] = ZERO
    else:
        point = at + 1 + e if plain else at + 1
        for place in range(at, point):
            out[place] = out[place + 1]
    out[point] = POINT
    at = end if end > point + 1 else point
    if not plain:
        out[at], out[at + 1] = EXPONENT, MINUS if e < 0 else PLUS
        _write_digits(np.uint64(abs(e)), 2, out, at + 4)
        at += 4
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
):
    """Write rows of numbers by %.{digits}g, up to the first that is not 0 or 1e-10 ≤ |x| < 1e22.

    Return how many rows were written, and where they end.

    Args:
        rows: (N, K) numbers.
        digits: 6 … 12.
        parts: K + 1 texts, one after the other, between the numbers of each row.
        ends: (K + 1,) where each of them ends.
        powers, wholes: 10^0, 10^1, …
        out: the text.
    """
    at, width = 0, rows.shape[1]
    for r in range(rows.shape[0]):
        for k in range(width):
            if rows[r, k] != 0 and not SMALLEST <= abs(rows[r, k]) < LARGEST:
                return r, at
        for k in range(width):
            at = _write_part(parts, ends, k, out, at)
            at = _write_number(rows[r, k], digits, powers, wholes, out, at)
        at = _write_part(parts, ends, width, out, at)
    return rows.shape[0], at


@kernel
def write_wholes(rows: i8_2d, parts: i1_1d, ends: i8_1d, out: i1_1d):
    """Write rows of whole numbers by %d, up to the first below 0; as ``write_numbers``."""
    at, width = 0, rows.shape[1]
    for r in range(rows.shape[0]):
        for k in range(width):
            if rows[r, k] < 0:
                return r, at
        for k in range(width):
            at = _write_part(parts, ends, k, out, at)
            at = _write_whole(rows[r, k], out, at)
        at = _write_part(parts, ends, width, out, at)
    return rows.shape[0], at


@kernel
def write_faces(
    offsets: i8_1d,
    begin: int,
    end: int,
    vertices: i8_1d,
    coordinates: i8_1d,
    normals: i8_1d,
    out: i1_1d,
):
    """Write lines ``f v/vt/vn …`` of some faces, counted from 1; return where they end.

    Args:
        offsets: where the corners of each face begin.
        begin, end: the faces.
        vertices, coordinates, normals: what each corner names; without any, its slash is left out.
        out: the text.
    """
    at = 0
    for face in range(begin, end):
        out[at], at = FACE, at + 1
        for corner in range(offsets[face], offsets[face + 1]):
            out[at] = BLANK
            at = _write_whole(vertices[corner] + 1, out, at + 1)
            if len(coordinates) > 0:
                out[at] = SLASH
                at = _write_whole(coordinates[corner] + 1, out, at + 1)
            elif len(normals) > 0:
                out[at], at = SLASH, at + 1
            if len(normals) > 0:
                out[at] = SLASH
                at = _write_whole(normals[corner] + 1, out, at + 1)
        out[at], at = LINE_END, at + 1
    return at
