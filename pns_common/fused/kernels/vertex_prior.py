"""The prior of old vertices, with the bits of rules/scale_free.py and formula/tips.py."""

from __future__ import annotations

import math

from pns_common.formula.tips import BENDS_MORE, LEFT
from pns_common.fused.kernels.compiled import (
    INDEX,
    NUMBERS,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.normals import NORMAL_NUMBERS
from pns_common.fused.kernels.rings import MEAN_JUMP, NEAR_JUMP, RING_SQUARE, UMBRELLA, clear_normal
from pns_common.fused.kernels.vectors import dot, row

# A kernel reads numbers, not pairs.
(LEFT_FROM, LEFT_TO), (BENDS_FROM, BENDS_TO) = LEFT, BENDS_MORE
# The square of a quotient that is less than LEFT_FROM whatever is rounded.
CLEARLY_NEAR = (1 - 1e-9) * LEFT_FROM**2


def _prior(pushed, of_curves, nothing, strength, v, k):
    """Return a coordinate of D_v, with the curves' part."""
    part = of_curves[v, k] if len(of_curves) else nothing
    return strength * pushed[v, k] + part


def rise(value, by, begin, end):
    """Return the smooth step of a quotient; 0 where ``by`` is 0 (``tips.far_behind``)."""
    quotient = value / by if by > 0 else 0.0
    way = min(max((quotient - begin) / (end - begin), 0.0), 1.0)
    return way * way * (3 - 2 * way)


def _tip(behind, means, fields, v):
    """Return how much of a tip a vertex is, 0 … 1, of what is left behind there (``tips``)."""
    square = means[v, RING_SQUARE]
    near = CLEARLY_NEAR * square
    if near > NORMAL_NUMBERS and dot(behind, behind) < near:
        return 0.0  # as most are: no root or quotient need be taken
    left = abs(dot(behind, clear_normal(row(fields, v))))
    length = math.sqrt(square) if square > 0 else 0.0
    far = rise(left, length, LEFT_FROM, LEFT_TO)
    return far * rise(means[v, MEAN_JUMP], means[v, NEAR_JUMP], BENDS_FROM, BENDS_TO)


@kernel(SIZE, POINTS, REAL, NUMBERS, INDEX, SIZE, SIZE, POINTS_OUT)
def add_priors(of_curves, nothing, strengths, vertices, begin, end, pushed):
    """Write D_v over ``pushed``, Loop's vertex mask of d, in the rows vertices[begin:end].

    ``of_curves`` is the same of curves' pushes; (0, 3) where there are none. Then ``nothing`` is
    added: 0 where a rule moves curves, −0 where none does. ``strengths`` is s of each of the rows.
    """
    for i in range(natural(begin), end):
        v = vertices[i]
        for k in range(3):
            pushed[v, k] = _prior(pushed, of_curves, nothing, strengths[i], v, k)
    return 0


@kernel(
    SIZE,
    *(POINTS, REAL, NUMBERS, INDEX, SIZE, SIZE),
    *(POINTS, POINTS, POINTS, INDEX, NUMBERS, NUMBERS, REAL, POINTS_OUT),
)
def add_priors_but_at_tips(
    of_curves,
    nothing,
    strengths,
    vertices,
    begin,
    end,
    pushes,
    means,
    fields,
    valence,
    ring_weight,
    further,
    tip_strength,
    pushed,
):
    """Write D'_v likewise (``tips.kept_at_tips``).

    Args:
        pushes: d.
        ring_weight, further: k β_k and λ for each valence that occurs.
        tip_strength: a.
    """
    for i in range(natural(begin), end):
        v = vertices[i]
        step, ahead = ring_weight[valence[v]], further[valence[v]]
        moved = (
            step * means[v, UMBRELLA],
            step * means[v, UMBRELLA + 1],
            step * means[v, UMBRELLA + 2],
        )
        behind = (
            ahead * (pushes[v, 0] - pushed[v, 0] - moved[0]) - pushes[v, 0],
            ahead * (pushes[v, 1] - pushed[v, 1] - moved[1]) - pushes[v, 1],
            ahead * (pushes[v, 2] - pushed[v, 2] - moved[2]) - pushes[v, 2],
        )
        tip = _tip(behind, means, fields, v)
        for k in range(3):
            prior = _prior(pushed, of_curves, nothing, strengths[i], v, k)
            pushed[v, k] = prior - tip * (tip_strength * moved[k] + prior)
    return 0
