"""Which faces of a piece have the whole's bits: followed through the levels, not assumed.

A face is *exact* if its corners are where the whole mesh's refinement has them. All of a piece's
control faces are; each level's rules take some away from the rim (halo.py says how many rings).

The fold guard is followed too. A child that no scales in [0, 1] of its corners can fold never
changes a scale, so scales depend on nothing beyond such faces: what is not known at the rim spreads
inwards through the others alone, and where it stops all rounds of the guard were the whole's.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import cross, dot, marked, norm
from pns_common.geometry.frames import NO_AREA

# Beside the rounding of a few products; angles are not that near to θ by chance.
CAUTION = 1 - 1e-9
# A face that loses no more of its area vector keeps far more than the guard asks for.
MOST_CHANGE = 0.99


def shrunk(
    exact: Bool[np.ndarray, " F"],
    faces: Int[np.ndarray, "F 3"],
    rim: Bool[np.ndarray, " V"],
) -> Bool[np.ndarray, " F"]:
    """Return the faces that only touch exact ones, and no vertex of ``rim``.

    Of the faces around a vertex of ``rim`` some are lacking.
    """
    beside = rim.copy()
    beside[faces[~exact].reshape(-1)] = True
    return exact & ~beside[faces].any(axis=1)


def guarded_exact(
    exact: Bool[np.ndarray, " C"],
    children: Int[np.ndarray, "C 3"],
    loop: Float[np.ndarray, "W 3"],
    asked: Float[np.ndarray, "W 3"],
    angle: float,
) -> Bool[np.ndarray, " C"]:
    """Return the children that are still exact once the guard has scaled their corners.

    Args:
        exact: those that were before.
        children: faces of the split mesh.
        loop, asked: where Loop puts its vertices, and what was to be added: not finite where that
            is not known.
        angle: θ of the guard, radians.
    """
    unknown = marked(children[~exact].reshape(-1), len(loop))
    seen = ~exact
    while True:
        front = np.flatnonzero(unknown[children].any(axis=1) & ~seen)
        seen[front] = True
        may = front[may_fold(children[front], loop, asked, angle)]
        if not len(may):
            return exact & ~unknown[children].any(axis=1)
        unknown[children[may].reshape(-1)] = True


def may_fold(
    faces: Int[np.ndarray, "N 3"],
    loop: Float[np.ndarray, "W 3"],
    asked: Float[np.ndarray, "W 3"],
    angle: float,
) -> Bool[np.ndarray, " N"]:
    """Return whether scales in [0, 1] of the corners could make the guard act; True if in doubt.

    With sides u, v that change by Δu, Δv, the area vector changes by at most ‖Δu‖ ‖v‖ + ‖u‖ ‖Δv‖ +
    ‖Δu‖ ‖Δv‖. If that is less than sin θ times its length, it turns by less than θ and keeps more
    than 1 − sin θ of its length. ‖s_b δ_b − s_a δ_a‖ is convex in the scales, so it is largest
    where they are 0 or 1. Faces without area are never folded.
    """
    a, b, c = (loop[faces[:, corner]] for corner in range(3))
    u, v = b - a, c - a
    area = cross(u, v)
    has_area = dot(area, area) > (NO_AREA * (dot(u, u) + dot(v, v))) ** 2
    with np.errstate(over="ignore", invalid="ignore"):
        by = [asked[faces[:, corner]] for corner in range(3)]
        du, dv = _largest_change(by[0], by[1]), _largest_change(by[0], by[2])
        change = du * norm(v) + norm(u) * dv + du * dv
        kept = change < CAUTION * min(np.sin(angle), MOST_CHANGE) * norm(area)
    return has_area & ~kept


def _largest_change(
    first: Float[np.ndarray, "N 3"], second: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, " N"]:
    """Return the largest ‖s δ − s' δ'‖ for s, s' in [0, 1]; ∞ where a number is not finite."""
    sizes = np.stack([_size(first), _size(second), _size(first - second)])
    return sizes.max(axis=0)


def _size(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Return lengths; NaN and ∞ stay what they are."""
    return np.sqrt(dot(vectors, vectors))
