"""The bounded correction δ of each new vertex: equation 1 of the paper, and the default's rule."""

from __future__ import annotations

from pns_common.kernels import Connectivity, b1_1d, f8_1d, f8_2d, i8_1d, inlined, kernel, u4_1d
from pns_common.kernels.connectivity import INTERIOR
from pns_common.kernels.vectors import dot, norm, over, row

# Products above this have all their digits.
NORMAL_NUMBERS = 1e-300
# By so much less, no rounding makes a vector longer than its bound.
CLEARLY_SHORTER = 1 - 1e-14


@inlined
def in_ball(z):
    """Shorten z to length 1, also where it is huge; do not lengthen it."""
    if dot(z, z) <= 1:
        return z
    largest = max(max(abs(z[0]), abs(z[1])), abs(z[2]))
    length = norm(over(z, largest)) * largest if largest > 1 else norm(z)
    if length > 1:
        factor = 1.0 / length
        return z[0] * factor, z[1] * factor, z[2] * factor
    return z


@inlined
def shortened(v, longest):
    """Return Π_ρ v: v shortened to length ρ = ``longest`` if it is longer."""
    bound = CLEARLY_SHORTER * (longest * longest)
    if bound > NORMAL_NUMBERS and dot(v, v) <= bound:
        return v  # no root need be taken
    length = norm(v)
    if length > longest:
        factor = longest / length
        return v[0] * factor, v[1] * factor, v[2] * factor
    return v


@inlined
def combined(z, basis, i):
    """Return F z: the combination of the three rows of a (N, 9) basis."""
    return (
        z[0] * basis[i, 0] + z[1] * basis[i, 3] + z[2] * basis[i, 6],
        z[0] * basis[i, 1] + z[1] * basis[i, 4] + z[2] * basis[i, 7],
        z[0] * basis[i, 2] + z[1] * basis[i, 5] + z[2] * basis[i, 8],
    )


@inlined
def _write(at, delta, gate, bound, displacement, ratio, gates, bounds):
    """Write δ, ‖δ‖ / ρ (0 where ρ is), γ, and ρ where the gate is open."""
    for k in range(3):
        displacement[at, k] = delta[k]
    ratio[at] = norm(delta) / bound if bound > 0 else 0.0
    gates[at], bounds[at] = gate, bound if gate != 0 else 0.0


@kernel
def correct_by_equation_1(
    rows: u4_1d,
    first: int,
    eta: f8_2d,
    frames: f8_2d,
    gate: f8_1d,
    bound: f8_1d,
    displacement: f8_2d,
    ratio: f8_1d,
    gates: f8_1d,
    bounds: f8_1d,
):
    """Write δ = h² γ F η (C / R), ‖η‖ ≤ 1, at ``rows`` of the output, from ``first`` on.

    ``eta``, ``frames``, ``gate`` and ``bound`` (C h² / R) have a row for each of them.
    """
    for i in range(rows.shape[0]):
        turned = combined(in_ball(row(eta, i)), frames, i)
        size = bound[i] * gate[i]
        delta = size * turned[0], size * turned[1], size * turned[2]
        _write(first + rows[i], delta, gate[i], bound[i], displacement, ratio, gates, bounds)


@kernel
def place_flat(points: f8_2d, mesh: Connectivity, ringed: b1_1d, base: f8_2d, flat: f8_2d):
    """Write D of vertices and of edges, from x0 = ``base`` to flat; 0 where no network acts."""
    count = points.shape[0]
    for v in range(count):
        for k in range(3):
            flat[v, k] = points[v, k] - base[v, k] if ringed[v] else 0.0
    for e in range(mesh.edges.shape[0]):
        a, b, to, acts = (
            mesh.edges[e, 0],
            mesh.edges[e, 1],
            count + e,
            mesh.edge_class[e] == INTERIOR,
        )
        for k in range(3):
            middle = (points[a, k] + points[b, k]) / 2
            flat[to, k] = middle - base[to, k] if acts else 0.0


@kernel
def correct_from_flat(
    begin: int,
    end: int,
    rows: u4_1d,
    first: int,
    asked: f8_2d,
    reach: f8_1d,
    gate: f8_1d,
    bound: f8_1d,
    displacement: f8_2d,
    ratio: f8_1d,
    gates: f8_1d,
    bounds: f8_1d,
):
    """Write δ = γ Π_ρ(D + τ h u), ‖u‖ ≤ 1, at rows[begin:end] of the output, from ``first`` on.

    Args:
        asked: u = F z of all N edges, vertices or faces; rows count in it, and in these:
        reach, gate, bound: (N,) τ h, γ, ρ.
        displacement: in: D; out: δ.
    """
    for i in range(max(begin, 0), end):
        here = rows[i]
        at, u = first + here, in_ball(row(asked, here))
        wanted = (
            displacement[at, 0] + reach[here] * u[0],
            displacement[at, 1] + reach[here] * u[1],
            displacement[at, 2] + reach[here] * u[2],
        )
        inside, size = shortened(wanted, bound[here]), gate[here]
        delta = size * inside[0], size * inside[1], size * inside[2]
        _write(at, delta, size, bound[here], displacement, ratio, gates, bounds)


@kernel
def add_on_curves(
    rows: i8_1d,
    share: f8_1d,
    prior: f8_2d,
    bound: f8_1d,
    displacement: f8_2d,
    ratio: f8_1d,
    bounds: f8_1d,
):
    """Add share Π_ρ(D) to δ at new vertices of curves: ``rows`` of the output, with ρ = ``bound``.

    Args:
        prior: (M, 3) D along the curves.
        bounds: in: ρ of the rule for surfaces, which acted by 1 − share at most; out: the mean of
            both bounds.
    """
    for i in range(len(rows)):
        at = rows[i]
        inside = shortened(row(prior, i), bound[i])
        for k in range(3):
            displacement[at, k] += share[i] * inside[k]
        bounds[at] = (1 - share[i]) * bounds[at] + share[i] * bound[i]
        length = norm(row(displacement, at))
        ratio[at] = length / bounds[at] if bounds[at] > 0 else 0.0
