"""What is added at interior edges, with the bits of correction.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
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
from pns_common.fused.kernels.normals import NORMAL_NUMBERS
from pns_common.fused.kernels.vectors import dot, norm, row
from pns_common.masks.stencils import EDGE_ENDPOINT, EDGE_OPPOSITE

# By so much less no rounding makes a vector longer than its bound.
CLEARLY_SHORTER = 1 - 1e-14


def in_ball(z):
    """Shorten a vector to length 1, as ``correction.project_to_ball`` does."""
    if dot(z, z) <= 1:
        return z  # as most are: nor is the root of that more than 1
    largest = max(max(abs(z[0]), abs(z[1])), abs(z[2]))
    if largest > 1:
        length = norm((z[0] / largest, z[1] / largest, z[2] / largest)) * largest
    else:
        length = norm(z)
    if length > 1:
        factor = 1.0 / length
        return z[0] * factor, z[1] * factor, z[2] * factor
    return z


def _rotated(frame, i, z):
    return (
        z[0] * frame[i, 0] + z[1] * frame[i, 3] + z[2] * frame[i, 6],
        z[0] * frame[i, 1] + z[1] * frame[i, 4] + z[2] * frame[i, 7],
        z[0] * frame[i, 2] + z[1] * frame[i, 5] + z[2] * frame[i, 8],
    )


def shortened(v, longest):
    """Shorten a vector to ``longest``, as ``correction.shortened`` does."""
    bound = CLEARLY_SHORTER * (longest * longest)
    if bound > NORMAL_NUMBERS and dot(v, v) <= bound:
        return v  # as most are: no root need be taken
    length = norm(v)
    if length > longest:
        factor = longest / length
        return v[0] * factor, v[1] * factor, v[2] * factor
    return v


def gated(gate, v, nothing):
    """Return γ v, and the nothing that a rule for curves adds."""
    return gate * v[0] + nothing, gate * v[1] + nothing, gate * v[2] + nothing


def write(index, delta, gate, envelope, displacement, ratio, gates, envelopes):
    """Write δ, ‖δ‖ / ρ (0 where the envelope is empty), γ, and ρ where the gate is not shut."""
    for k in range(3):
        displacement[index, k] = delta[k]
    ratio[index] = norm(delta) / envelope if envelope > 0 else 0.0
    gates[index], envelopes[index] = gate, envelope if gate != 0 else 0.0


@kernel(
    SIZE,
    *(INDEX, SIZE, SIZE, POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT),
    *(POINTS, POINTS, NUMBERS, NUMBERS, NUMBERS),
)
def correct(
    interior,
    begin,
    end,
    displacement,
    ratio,
    gates,
    envelopes,
    eta,
    frame,
    length,
    gate,
    budget_per_length,
):
    """Write δ = h² γ F η into the rows of interior[begin:end] (``correction.correct``).

    Row 0 of what comes after the output is the first of these edges'.
    """
    for i in range(end - begin):
        e = interior[natural(begin) + i]
        envelope = budget_per_length[i] * (length[i] * length[i])
        turned = _rotated(frame, i, in_ball(row(eta, i)))
        size = envelope * gate[i]
        delta = size * turned[0], size * turned[1], size * turned[2]
        write(e, delta, gate[i], envelope, displacement, ratio, gates, envelopes)
    return 0


def _at_edge(pushes, a, b, c, d, k):
    """Return a coordinate of what Loop's edge mask makes of pushes."""
    ends, sides = pushes[a, k] + pushes[b, k], pushes[c, k] + pushes[d, k]
    return EDGE_ENDPOINT * ends + EDGE_OPPOSITE * sides


def _prior(pushes, of_curves, nothing, a, b, c, d, k, strength):
    """Return a coordinate of D_e, with the curves' part."""
    part = _at_edge(of_curves, a, b, c, d, k) if len(of_curves) else nothing
    return strength * _at_edge(pushes, a, b, c, d, k) + part


@kernel(
    SIZE,
    *(NUMBERS, POINTS, POINTS, REAL, REAL, INDEX, SIZE, SIZE),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT),
    *(POINTS, POINTS, NUMBERS, NUMBERS, NUMBERS, INDICES, NUMBERS),
)
def correct_scale_free(
    network_lengths,
    pushes,
    of_curves,
    nothing,
    scale,
    interior,
    begin,
    end,
    displacement,
    ratio,
    gates,
    envelopes,
    z,
    frame,
    bound_length,
    gate,
    budget_per_length,
    stencils,
    strengths,
):
    """Write δ = γ Π_ρ(D + τ ℓ F z) likewise (``correction.correct_scale_free``).

    ``network_lengths`` are ℓ of all edges, ``bound_length`` is h of the bound, ``strengths`` s.
    ``of_curves`` are the curves' pushes; (0, 3) where there are none. Then ``nothing`` is
    added in their place: 0, or −0 where there is no rule for boundaries, which changes no −0.
    """
    for i in range(end - begin):
        e = interior[natural(begin) + i]
        a, b, c, d = stencils[i, 0], stencils[i, 1], stencils[i, 2], stencils[i, 3]
        envelope = budget_per_length[i] * (bound_length[i] * bound_length[i])
        turned = _rotated(frame, i, in_ball(row(z, i)))
        asked, strength = scale * network_lengths[e], strengths[i]
        wanted = (
            _prior(pushes, of_curves, nothing, a, b, c, d, 0, strength) + asked * turned[0],
            _prior(pushes, of_curves, nothing, a, b, c, d, 1, strength) + asked * turned[1],
            _prior(pushes, of_curves, nothing, a, b, c, d, 2, strength) + asked * turned[2],
        )
        delta = gated(gate[i], shortened(wanted, envelope), nothing)
        write(e, delta, gate[i], envelope, displacement, ratio, gates, envelopes)
    return 0
