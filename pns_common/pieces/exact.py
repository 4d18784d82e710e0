"""Which faces of a piece have the whole's bits: followed through the levels, not assumed.

A face is *exact* if its corners are where the whole mesh's refinement has them. All of a piece's
control faces are; each level's rules take some away from the rim (halo.py says how many rings).

The fold guard is followed too, round by round beside the whole's: of a vertex at the rim it is not
known what is added there, nor how it is scaled. A face beside such vertices that no scales of
theirs can fold, with its other corners scaled as they are, does what it does in the whole; of one
that may fold, no corner's scale is known from then on. So what is not known spreads a ring a round
at most, and through such faces alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.arrays import cross, dot
from pns_common.edge.frames import NO_AREA
from pns_common.fold_guard import LEAST_AREA, ROUNDS, turned

# Far more than computed cosines, and areas beside what they were, are wrong by.
CAUTION = 1e-12


def shrunk(
    exact: Bool[np.ndarray, " F"],
    faces: Int[np.ndarray, "F 3"],
    rim: Bool[np.ndarray, " V"],
) -> Bool[np.ndarray, " F"]:
    """The faces that only touch exact ones, and no vertex of ``rim``, whose faces lack some."""
    beside = rim.copy()
    beside[faces[~exact].reshape(-1)] = True
    return exact & ~beside[faces].any(axis=1)


@dataclass(frozen=True, eq=False)
class Guarded:
    """What the fold guard looks at, on a piece.

    Attributes:
        faces: those of the split mesh.
        loop: where Loop puts its vertices.
        asked: what was to be added.
        cosines: of how far each face may turn.
        scaled: vertices that the guard scaled on the piece alone.
    """

    faces: Int[np.ndarray, "C 3"]
    loop: Float[np.ndarray, "W 3"]
    asked: Float[np.ndarray, "W 3"]
    cosines: Float[np.ndarray, " C"]
    scaled: Bool[np.ndarray, " W"]


def guarded_exact(
    exact: Bool[np.ndarray, " C"], guarded: Guarded, first: Bool[np.ndarray, " W"] | None = None
) -> Bool[np.ndarray, " C"]:
    """The faces of the split mesh that are still exact once the guard has scaled their corners.

    Args:
        exact: those that were before.
        first: vertices that are settled first (``FoldGuard``).
    """
    unknown = np.zeros(len(guarded.loop), dtype=bool)
    unknown[guarded.faces[~exact].reshape(-1)] = True
    if first is None:
        _follow(guarded, np.ones(len(unknown)), np.ones_like(unknown), unknown)
    else:
        alone = _follow(guarded, first.astype(float), first, unknown)
        _follow(guarded, np.where(first, alone, 1.0), ~first, unknown)
    return exact & ~unknown[guarded.faces].any(axis=1)


def _follow(
    guarded: Guarded,
    scale: Float[np.ndarray, " W"],
    free: Bool[np.ndarray, " W"],
    unknown: Bool[np.ndarray, " W"],
) -> Float[np.ndarray, " W"]:
    """Lower s of free vertices as the guard does; what is unknown grows."""
    faces, rounds = guarded.faces, 0
    faces_at = _faces_at(faces, len(unknown))
    # Before any scale changes, what is known is on the piece as it is in the whole: a face whose
    # corners were never scaled there is not folded.
    beside = (unknown | guarded.scaled)[faces].any(axis=1)
    watched = np.flatnonzero(beside & ~unknown[faces].all(axis=1))
    while len(watched):
        folded = watched[_folds(guarded, watched, scale, unknown)]
        certain = ~unknown[faces[folded]].any(axis=1)
        sure, unsure = (np.unique(faces[rows]) for rows in (folded[certain], folded[~certain]))
        newly = unsure[free[unsure] & ~unknown[unsure]]
        unknown[newly] = True
        lower = sure[free[sure] & ~unknown[sure] & (scale[sure] > 0)]
        scale[lower] = scale[lower] / 2 if rounds < ROUNDS else 0.0
        watched = faces_at(np.concatenate([newly, lower]))
        rounds += 1
    return scale


def _faces_at(
    faces: Int[np.ndarray, "C 3"], vertex_count: int
) -> Callable[[Int[np.ndarray, " N"]], Int[np.ndarray, " M"]]:
    """What finds the faces that have one of some vertices as a corner."""
    corners = faces.reshape(-1)
    order = np.argsort(corners, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(corners, minlength=vertex_count))])

    def at(vertices: Int[np.ndarray, " N"]) -> Int[np.ndarray, " M"]:
        begin, count = starts[vertices], starts[vertices + 1] - starts[vertices]
        first = np.repeat(begin - np.cumsum(count) + count, count)
        return np.unique(order[first + np.arange(count.sum())] // 3)

    return at


def _folds(
    guarded: Guarded,
    rows: Int[np.ndarray, " N"],
    scale: Float[np.ndarray, " W"],
    unknown: Bool[np.ndarray, " W"],
) -> Bool[np.ndarray, " N"]:
    """Whether faces are folded, or might be where a corner's scale is unknown."""
    faces, cosines = guarded.faces[rows], guarded.cosines[rows]
    corners = faces.reshape(-1)
    before = guarded.loop[corners]
    after = before + scale[corners, None] * guarded.asked[corners]
    folds = turned(np.arange(len(corners)).reshape(-1, 3), before, after, cosines)
    doubtful = np.flatnonzero(unknown[faces].any(axis=1))
    folds[doubtful] = may_fold(guarded, rows[doubtful], scale, unknown)
    return folds


def may_fold(
    guarded: Guarded,
    rows: Int[np.ndarray, " N"],
    scale: Float[np.ndarray, " W"],
    unknown: Bool[np.ndarray, " W"],
) -> Bool[np.ndarray, " N"]:
    """Whether some scales in [0, 1] of unknown corners fold a face; True if in doubt.

    The area vector is affine in each of the three scales, so it lies among those with scales 0 and
    1. If these all turn by less than θ, they lie in a cone that is convex, and so does every other.
    Faces without area are never folded.
    """
    faces, cosines = guarded.faces[rows], guarded.cosines[rows]
    corners = [guarded.loop[faces[:, i]] for i in range(3)]
    old, has_area = _area(*corners)
    size = np.sqrt(dot(old, old))
    kept = np.ones(len(faces), dtype=bool)
    with np.errstate(over="ignore", invalid="ignore"):
        for at in product((0.0, 1.0), repeat=3):
            moved = [
                corner + _added(guarded, faces[:, i], scale, unknown, at[i])
                for i, corner in enumerate(corners)
            ]
            new, _ = _area(*moved)
            along = dot(old, new)
            kept &= along >= (cosines + CAUTION) * size * np.sqrt(dot(new, new))
            kept &= along >= (LEAST_AREA + CAUTION) * size * size
    return has_area & ~kept


def _added(
    guarded: Guarded,
    vertices: Int[np.ndarray, " N"],
    scale: Float[np.ndarray, " W"],
    unknown: Bool[np.ndarray, " W"],
    at: float,
) -> Float[np.ndarray, "N 3"]:
    """s δ, with s = `at` where it is unknown; 0 for s = 0, whatever δ is."""
    s = np.where(unknown[vertices], at, scale[vertices])[:, None]
    return np.where(s > 0, s * guarded.asked[vertices], 0.0)


def _area(
    a: Float[np.ndarray, "N 3"], b: Float[np.ndarray, "N 3"], c: Float[np.ndarray, "N 3"]
) -> tuple[Float[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
    """Twice the area vectors, and whether they are more than rounding."""
    u, v = b - a, c - a
    area = cross(u, v)
    return area, dot(area, area) > (NO_AREA * (dot(u, u) + dot(v, v))) ** 2
