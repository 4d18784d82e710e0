"""Tips: vertices that quasi-interpolation leaves far behind go back to where they were.

The prior is one pass: where a surface is smooth the limit then runs through the vertices, since the
pushes of neighbours are alike. At a tip they are not, and Loop takes off most of it. What the pass
leaves is

    e = p − L(p + d) = λ (d − D − (p0 − p)) − d

L is the limit: it lies λ times as far from a point as Loop's first move takes that. λ = 4/3 on
curves, w_k / (k β_k) = 1 / (k β_k + 3/8) in a closed ring. The longer e is for the spokes, the more
of Loop's own move is given back in place of the prior:

    D' = D + t (a (p − p0) − D)        t = f(|e| / h) g(x_v / mean of x_j)

f rises from 0 at 1/20 to 1 at 3/20, smoothly. |e| is measured across: along the normal in a ring,
off the direction of a curve. On planes and straight curves it is 0, and on smooth surfaces of a
higher order than the push, so that t is 0 there.

g, of rings alone, asks whether a vertex is more of a tip than those around it: it rises from 0
where it bends as much as the mean of its neighbours to 1 where it bends twice as much. All vertices
of an octahedron are left behind by 0.22 h; it may stand for a sphere, and stays round.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, namespace
from pns_common.geometry.ring_sums import divided
from pns_common.masks.stencils import CURVE_CENTRE, CURVE_LIMIT_CENTRE, loop_ring_weight

# Where f and g begin to rise, and where they end.
LEFT, BENDS_MORE = (0.05, 0.15), (1.0, 2.0)
# λ of a cubic B-spline: its limit moves a vertex by 1/3 of the umbrella, the first step by 1/4.
CURVE_FURTHER = (1 - CURVE_LIMIT_CENTRE) / (1 - CURVE_CENTRE)


def ring_further(valence: Int[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return λ = 1 / (k β_k + 3/8) of closed rings."""
    return 1 / (loop_ring_weight(valence) + 3 / 8)


def left_behind(
    pushes: Float[Array, "N 3"],
    pushed: Float[Array, "N 3"],
    moved: Float[Array, "N 3"],
    further: float | Float[Array, "N 1"],
) -> Float[Array, "N 3"]:
    """Return e from d, D (Loop's mask of all d), Loop's move p0 − p, and λ."""
    return further * (pushes - pushed - moved) - pushes


def far_behind(left: Float[Array, "N 1"], length: Float[Array, "N 1"]) -> Float[Array, "N 1"]:
    """Return f from |e| and h."""
    return _rise(divided(left, length), *LEFT)


def bends_most(bend: Float[Array, "N 1"], around: Float[Array, "N 1"]) -> Float[Array, "N 1"]:
    """Return g from x of vertices and its mean over their neighbours."""
    return _rise(divided(bend, around), *BENDS_MORE)


def kept_at_tips(
    prior: Float[Array, "N 3"],
    moved: Float[Array, "N 3"],
    tip: Float[Array, "N 1"],
    strength: float,
) -> Float[Array, "N 3"]:
    """Return D' from D, p0 − p, t, and a = ``strength``."""
    return prior - tip * (strength * moved + prior)


def _rise(value: Float[Array, "N 1"], begin: float, end: float) -> Float[Array, "N 1"]:
    """Return 0 up to one value, 1 from another on, and a smooth step between them."""
    way = namespace(value).clip((value - begin) / (end - begin), 0.0, 1.0)
    return way * way * (3 - 2 * way)
