"""What old vertices see and what is added there, with the bits of formula/vertex_operator.py."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    INDEX,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edge_correction import gated, in_ball, shortened, write
from pns_common.fused.kernels.rings import (
    BEND_SQUARE,
    HEIGHT,
    LENGTH,
    MEAN_BEND,
    MEAN_JUMP,
    MEAN_NETWORK_SQUARE,
    NEAR_HEIGHT,
    NEAR_JUMP,
    OPENING,
    PULL,
    RING_SQUARE,
    UMBRELLA,
)
from pns_common.fused.kernels.vectors import dot, row


def _divided(value, by):
    return value / by if by > 0 else 0.0


def _root(square):
    return math.sqrt(square) if square > 0 else 0.0


def _reach(means, v):
    return _root(means[v, RING_SQUARE])


@kernel(SIZE, POINTS, POINTS, INDEX, SIZE, SIZE, POINTS_OUT, NUMBERS_OUT)
def look_around(means, fields, vertices, begin, end, features, mean_jump):
    """Write the features of ``ring-10`` and x_v of vertices[begin:end]."""
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        normal, umbrella, reach = row(fields, v), row(means, v), _reach(means, v)
        features[i, 0] = means[v, MEAN_JUMP]
        features[i, 1] = means[v, MEAN_BEND]
        features[i, 2] = means[v, BEND_SQUARE]
        features[i, 3] = fields[v, HEIGHT]
        features[i, 4] = _divided(dot(umbrella, umbrella), means[v, RING_SQUARE])
        features[i, 5] = dot(normal, normal)
        features[i, 6] = means[v, NEAR_HEIGHT]
        features[i, 7] = _divided(means[v, OPENING], reach)
        features[i, 8] = _divided(means[v, LENGTH], reach)
        features[i, 9] = means[v, NEAR_JUMP]
        mean_jump[i] = means[v, MEAN_JUMP]
    return 0


def _component(z, means, fields, v, reach, k):
    umbrella, pull = means[v, UMBRELLA + k] / reach, means[v, PULL + k] / reach
    return z[0] * fields[v, k] + z[1] * umbrella + z[2] * pull


def _combined(z, means, fields, v):
    """Return Σ z_i e_i over the ring's three vectors."""
    reach = _reach(means, v)
    if not reach > 0:
        # Both means count for 0.
        nothing = z[1] * 0.0, z[2] * 0.0
        return (
            z[0] * fields[v, 0] + nothing[0] + nothing[1],
            z[0] * fields[v, 1] + nothing[0] + nothing[1],
            z[0] * fields[v, 2] + nothing[0] + nothing[1],
        )
    x = _component(z, means, fields, v, reach, 0)
    y = _component(z, means, fields, v, reach, 1)
    return x, y, _component(z, means, fields, v, reach, 2)


@kernel(
    SIZE,
    *(POINTS, POINTS, INDEX, SIZE, SIZE, POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT),
    *(POINTS, NUMBERS, NUMBERS),
)
def correct(
    means,
    fields,
    vertices,
    begin,
    end,
    displacement,
    ratio,
    gates,
    envelopes,
    z,
    gate,
    budget_per_length,
):
    """Write δ = h_v² γ_v (C / R) v into the rows of vertices[begin:end] (``VertexOperator``).

    Row 0 of what comes after the output is the first of these vertices'.
    """
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        envelope = budget_per_length[i] * means[v, RING_SQUARE]
        vector = in_ball(_combined(in_ball(row(z, i)), means, fields, v))
        size = envelope * gate[i]
        delta = size * vector[0], size * vector[1], size * vector[2]
        write(v, delta, gate[i], envelope, displacement, ratio, gates, envelopes)
    return 0


@kernel(
    SIZE,
    *(POINTS, POINTS, POINTS, REAL, REAL, INDEX, SIZE, SIZE),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT),
    *(POINTS, NUMBERS, NUMBERS),
    by_rows=True,
)
def correct_scale_free(
    means,
    fields,
    prior,
    nothing,
    scale,
    vertices,
    begin,
    end,
    displacement,
    ratio,
    gates,
    envelopes,
    z,
    gate,
    budget_per_length,
):
    """Write δ = γ_v Π_ρ(D + τ ℓ_v Σ z_i e_i) likewise.

    ``prior`` is D_v, ``nothing`` as at edges.
    """
    for i in range(end - begin):
        v = vertices[natural(begin) + i]
        envelope = budget_per_length[i] * means[v, RING_SQUARE]
        learned = _combined(in_ball(row(z, i)), means, fields, v)
        asked = scale * _root(means[v, MEAN_NETWORK_SQUARE])
        wanted = (
            prior[v, 0] + asked * learned[0],
            prior[v, 1] + asked * learned[1],
            prior[v, 2] + asked * learned[2],
        )
        delta = gated(gate[i], shortened(wanted, envelope), nothing)
        write(v, delta, gate[i], envelope, displacement, ratio, gates, envelopes)
    return 0
