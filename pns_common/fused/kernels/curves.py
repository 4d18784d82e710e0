"""Curves and their pushes, with the bits of formula/curve_prior.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES_OUT,
    FLAGS,
    INDEX,
    INDICES,
    INDICES_OUT,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.owned import owned_rows
from pns_common.fused.kernels.vectors import between, difference, divisor, dot


@kernel(SIZE, INDICES, INDEX, FLAGS, INDEX, SIZE, SIZE, INDICES_OUT, CLASSES_OUT)
def follow_curves(edges, sharp_edges, of_curve, sharp, begin, end, sides, met):
    """Write the neighbours along curves of vertices begin … end − 1, and how many there are.

    Only vertices on two sharp edges are asked: those that have two neighbours are movable.

    Args:
        sharp_edges: (S,) the edges that are not interior, ascending.
        of_curve: (E,) which edges a curve is made of.
        sharp: (V,) how many sharp edges there are at each vertex.
        sides: (V, 2) out: the first edge's first.
        met: (V,) out.
    """
    for v in range(natural(begin), end):
        met[v] = 0
    for e in sharp_edges:
        if of_curve[e]:
            a, b = edges[e, 0], edges[e, 1]
            if begin <= a < end and sharp[a] == 2:
                sides[a, natural(met[a])] = b
                met[a] += 1
            if begin <= b < end and sharp[b] == 2:
                sides[b, natural(met[b])] = a
                met[b] += 1
    return 0


def over(v, size):
    """Return v / size."""
    return v[0] / size, v[1] / size, v[2] / size


def across(v, along):
    """Return the part of a vector that is at right angles to a unit vector."""
    size = dot(v, along)
    return v[0] - size * along[0], v[1] - size * along[1], v[2] - size * along[2]


def to_sides(points, sides, v):
    """Return a and b, from a vertex to its neighbours along the curve."""
    return between(points, v, sides[v, 0]), between(points, v, sides[v, 1])


@kernel(SIZE, POINTS, INDICES, INDEX, SIZE, SIZE, NUMBERS_OUT, by_rows=True)
def measure_turns(points, sides, vertices, begin, end, turns):
    """Write x of vertices[begin:end], which are movable: 1 − cos of the turning angle."""
    for i in range(end - begin):
        a, b = to_sides(points, sides, vertices[natural(begin) + i])
        turns[i] = 1 + dot(over(a, divisor(a)), over(b, divisor(b)))
    return 0


@kernel(SIZE, POINTS, INDICES, INDEX, NUMBERS, REAL, SIZE, SIZE, POINTS_OUT, by_rows=True)
def push_curves(points, sides, vertices, gates, strength, begin, end, pushes):
    """Write d of vertices[begin:end], from γ of each (``curve_prior.curve_pushes``).

    ``strength`` is b.
    """
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        a, b = to_sides(points, sides, v)
        chord = difference(b, a)
        middle = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2
        off = across(middle, over(chord, divisor(chord)))
        size = -(gates[i] / 3)
        for k in range(3):
            pushes[v, k] = strength * (size * off[k])
    return 0


@kernel(SIZE, POINTS, FLAGS, INDICES, INDICES, SIZE, SIZE, POINTS_OUT)
def sum_pushes(pushes, movable, edges, reach, begin, end, sums):
    """Write what ``masks.sum_rings`` makes of curves' pushes at vertices begin … end − 1.

    Vertices that are not movable have no push, and 0 changes no sum that begins with 0.
    """
    for v in range(natural(begin), end):
        for k in range(3):
            sums[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, asked = owned_rows(edges, reach, block, begin, end)
        for i in range(asked):
            e = first + i
            a, b = edges[e, 0], edges[e, 1]
            if movable[b] and begin <= a < end:
                for k in range(3):
                    sums[a, k] += pushes[b, k]
            if movable[a] and begin <= b < end:
                for k in range(3):
                    sums[b, k] += pushes[a, k]
    return 0
