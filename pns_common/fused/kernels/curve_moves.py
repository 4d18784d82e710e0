"""What curves add to vertices and edges, with the bits of rules/curves.py and formula/tips.py."""

from __future__ import annotations

import math

from pns_common.formula.curve_prior import CLEAR_CHORD
from pns_common.formula.tips import CURVE_FURTHER
from pns_common.fused.kernels.compiled import (
    FLAGS,
    INDEX,
    INDICES,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.curves import across, over, to_sides
from pns_common.fused.kernels.edge_correction import shortened
from pns_common.fused.kernels.vectors import between, difference, dot, norm, row
from pns_common.fused.kernels.vertex_prior import LEFT_FROM, LEFT_TO, rise
from pns_common.masks.stencils import CURVE_CENTRE, CURVE_NEIGHBOUR, MIDPOINT


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
        a, b = to_sides(points, sides, v)
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
    chord = difference(b, a)
    longer = max(norm(chord), (norm(a) + norm(b)) * CLEAR_CHORD)
    # Two neighbours at the vertex itself leave no direction.
    left = norm(across(behind, over(chord, longer if longer > 0 else math.inf)))
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
    """Write the same, at tips Loop's own move taken back.

    ``tip_strength`` is a, ``loop`` where Loop puts the vertices, in the rows of ``points``.
    """
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        a, b = to_sides(points, sides, v)
        moved, pushed = difference(row(loop, v), row(points, v)), _pushed(pushes, sides, v)
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
