"""The prior of curves, with the bits of curve_prior.py, tips.py and rules/curves.py."""

from __future__ import annotations

import math

from pns_common.formula.curve_prior import CLEAR_CHORD
from pns_common.formula.tips import CURVE_FURTHER
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
from pns_common.fused.kernels.edge_correction import shortened
from pns_common.fused.kernels.owned import owned_rows
from pns_common.fused.kernels.rings import between, divisor, dot, norm, row
from pns_common.fused.kernels.vertex_prior import LEFT_FROM, LEFT_TO, rise
from pns_common.masks.stencils import CURVE_CENTRE, CURVE_NEIGHBOUR, MIDPOINT


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


def _less(v, u):
    """Return v − u."""
    return v[0] - u[0], v[1] - u[1], v[2] - u[2]


def _over(v, size):
    return v[0] / size, v[1] / size, v[2] / size


def _across(v, along):
    """Return the part of a vector that is at right angles to a unit vector."""
    size = dot(v, along)
    return v[0] - size * along[0], v[1] - size * along[1], v[2] - size * along[2]


def _to_sides(points, sides, v):
    """Return a and b, from a vertex to its neighbours along the curve."""
    return between(points, v, sides[v, 0]), between(points, v, sides[v, 1])


@kernel(SIZE, POINTS, INDICES, INDEX, SIZE, SIZE, NUMBERS_OUT, by_rows=True)
def measure_turns(points, sides, vertices, begin, end, turns):
    """Write x of vertices[begin:end], which are movable: 1 − cos of the turning angle."""
    for i in range(end - begin):
        a, b = _to_sides(points, sides, vertices[natural(begin) + i])
        turns[i] = 1 + dot(_over(a, divisor(a)), _over(b, divisor(b)))
    return 0


@kernel(SIZE, POINTS, INDICES, INDEX, NUMBERS, REAL, SIZE, SIZE, POINTS_OUT, by_rows=True)
def push_curves(points, sides, vertices, gates, strength, begin, end, pushes):
    """Write d of vertices[begin:end], from γ of each (``curve_prior.curve_pushes``).

    ``strength`` is b.
    """
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        a, b = _to_sides(points, sides, v)
        chord = _less(b, a)
        middle = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2
        off = _across(middle, _over(chord, divisor(chord)))
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


def _pushed(pushes, sides, v):
    """Return what Loop's curve mask makes of pushes at a movable vertex."""
    own, one, other = row(pushes, v), row(pushes, sides[v, 0]), row(pushes, sides[v, 1])
    return (
        CURVE_CENTRE * own[0] + CURVE_NEIGHBOUR * (one[0] + other[0]),
        CURVE_CENTRE * own[1] + CURVE_NEIGHBOUR * (one[1] + other[1]),
        CURVE_CENTRE * own[2] + CURVE_NEIGHBOUR * (one[2] + other[2]),
    )


def _write(index, wanted, envelope, displacement, ratio, envelopes):
    """Write Π_ρ of what is wanted, its ratio to ρ (0 where that is 0), and ρ."""
    delta = shortened(wanted, envelope)
    for k in range(3):
        displacement[index, k] = delta[k] + 0.0  # beside 0 there is no −0
    ratio[index] = norm(delta) / envelope if envelope > 0 else 0.0
    envelopes[index] = envelope


def _mean_square(a, b):
    return (dot(a, a) + dot(b, b)) / 2


@kernel(
    SIZE,
    *(POINTS, POINTS, INDICES, INDEX, NUMBERS, SIZE, SIZE),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT),
    by_rows=True,
)
def move_vertices(
    points, pushes, sides, vertices, budget_per_length, begin, end, displacement, ratio, envelopes
):
    """Write δ, ‖δ‖ / ρ and ρ of vertices[begin:end] (``CurveRule.at_vertices``)."""
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        a, b = _to_sides(points, sides, v)
        envelope = budget_per_length[i] * _mean_square(a, b)
        _write(v, _pushed(pushes, sides, v), envelope, displacement, ratio, envelopes)
    return 0


def _far_behind(push, pushed, moved, a, b):
    """Return f of a vertex: how much of Loop's own move it gets back."""
    behind = (
        CURVE_FURTHER * (push[0] - pushed[0] - moved[0]) - push[0],
        CURVE_FURTHER * (push[1] - pushed[1] - moved[1]) - push[1],
        CURVE_FURTHER * (push[2] - pushed[2] - moved[2]) - push[2],
    )
    chord = _less(b, a)
    longer = max(norm(chord), (norm(a) + norm(b)) * CLEAR_CHORD)
    # Two neighbours at the vertex itself leave no direction.
    left = norm(_across(behind, _over(chord, longer if longer > 0 else math.inf)))
    square = _mean_square(a, b)
    return rise(left, math.sqrt(square) if square > 0 else 0.0, LEFT_FROM, LEFT_TO)


@kernel(
    SIZE,
    *(POINTS, POINTS, INDICES, INDEX, NUMBERS, SIZE, SIZE, POINTS, REAL),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT),
    by_rows=True,
)
def move_vertices_but_at_tips(
    points,
    pushes,
    sides,
    vertices,
    budget_per_length,
    begin,
    end,
    loop,
    tip_strength,
    displacement,
    ratio,
    envelopes,
):
    """Write the same, less at tips: ``loop`` is where Loop puts the vertices, ``tip_strength`` a.

    Rows of ``loop`` are those of ``points``.
    """
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        a, b = _to_sides(points, sides, v)
        moved, pushed = _less(row(loop, v), row(points, v)), _pushed(pushes, sides, v)
        tip = _far_behind(row(pushes, v), pushed, moved, a, b)
        wanted = (
            pushed[0] - tip * (tip_strength * moved[0] + pushed[0]),
            pushed[1] - tip * (tip_strength * moved[1] + pushed[1]),
            pushed[2] - tip * (tip_strength * moved[2] + pushed[2]),
        )
        envelope = budget_per_length[i] * _mean_square(a, b)
        _write(v, wanted, envelope, displacement, ratio, envelopes)
    return 0


@kernel(
    SIZE,
    *(POINTS, POINTS, FLAGS, INDICES, INDEX, NUMBERS, SIZE, SIZE),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT),
)
def move_edges(
    points,
    pushes,
    movable,
    edges,
    sharp_edges,
    budget_per_length,
    begin,
    end,
    displacement,
    ratio,
    envelopes,
):
    """Write δ, ‖δ‖ / ρ and ρ of sharp_edges[begin:end] (``CurveRule.at_edges``).

    Those are left alone that end at no movable vertex: they are of no curve, or do not move.
    """
    for i in range(end - begin):
        e = sharp_edges[natural(begin) + i]
        a, b = edges[e, 0], edges[e, 1]
        if movable[a] or movable[b]:
            edge = between(points, a, b)
            wanted = (
                MIDPOINT * (pushes[a, 0] + pushes[b, 0]),
                MIDPOINT * (pushes[a, 1] + pushes[b, 1]),
                MIDPOINT * (pushes[a, 2] + pushes[b, 2]),
            )
            envelope = budget_per_length[i] * dot(edge, edge)
            _write(e, wanted, envelope, displacement, ratio, envelopes)
    return 0
