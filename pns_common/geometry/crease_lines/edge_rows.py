"""Rows of edges, as a tube or an arc has them, and those that stand alone (mark 4)."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import cross, dot
from pns_common.connectivity.topology import EdgeClass
from pns_common.geometry.crease_lines.turns import (
    Edges,
    clearly_half,
    cosine_of,
    rises,
    turn_cosines,
)

# Degrees beyond which an edge of an edged mesh need not stand alone: between the turns of a hexagon
# and a heptagon.
ROW_ANGLE = 55.0
# Others are like an edge within 19.5 degrees of parallel (rims of 18 and 36 sides have some at 20,
# and rounding would decide), and where their 1 − cos t is at most so many times its own, and its
# own so many times theirs: of 45 degrees 30 and 60 are like, and 90 is not. Half as many degrees
# are always like: their 1 − cos t is more than a quarter.
PARALLEL, TIMES_ITS_OWN, TIMES_THEIRS = math.cos(math.radians(19.5)), 3.0, 4.0
# How many times as wide as the other the wider of an edge's walls may be: in a row four times, as
# where a simplifier made one wall of some, and where it ends they are those of one arc, no plates.
# Walls that are just four times as wide, or eleven tenths, are in it: else rounding would decide.
UNEVEN, UNEVEN_END = 4.05, 1.105
# Edges whose surroundings are looked at together.
AT_ONCE = 8192


def stand_alone(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
) -> Bool[np.ndarray, " N"]:
    """Return which interior edges turn far or are in no row."""
    alone = np.empty(len(flat), dtype=bool)
    # A dozen others are looked at for each: not for all at once.
    for start in range(0, len(flat), AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        alone[rows] = _stand_alone(points, normals, mesh, flat[rows])
    return alone


def _stand_alone(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
) -> Bool[np.ndarray, " N"]:
    turn = turn_cosines(normals, mesh, flat)
    gentle = clearly_half(turn)[:, None]
    has_like, has_sharper = (np.empty((2, len(flat)), dtype=bool) for _ in range(2))
    for side, face in enumerate((mesh.half_edges[flat] // 3).T):
        sides = mesh.face_edges[face]
        is_flat = (sides != flat[:, None]) & (turn_cosines(normals, mesh, sides) > gentle)
        beyond = _across(mesh, sides, face[:, None])
        # What lies across a side that is not flat, or is none, is the edge itself: no other.
        others = np.where(is_flat[:, :, None], mesh.face_edges[beyond], flat[:, None, None])
        seen = np.concatenate([sides, others.reshape(len(flat), -1)], axis=1)
        like, sharper = _beside(points, normals, mesh, flat, turn, seen)
        has_like[side], has_sharper[side] = like.any(axis=1), sharper.any(axis=1)
    ends = (has_like & has_sharper[::-1]).any(axis=0) & _as_wide(points, mesh, flat, UNEVEN_END)
    in_row = (has_like.all(axis=0) & _as_wide(points, mesh, flat, UNEVEN)) | ends
    return (turn < cosine_of(ROW_ANGLE)) | ~in_row


def _as_wide(
    points: Float[np.ndarray, "V 3"], mesh: Edges, flat: Int[np.ndarray, " N"], times: float
) -> Bool[np.ndarray, " N"]:
    """Return at which edges neither face is more than so many times as wide as the other."""
    # Over a common edge that is how their areas are.
    corners = points[mesh.faces[mesh.half_edges[flat].T.reshape(-1) // 3]]
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    first, second = dot(area, area).reshape(2, -1)
    most = times * times
    return (first <= most * second) & (second <= most * first)


def _beside(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
    turn: Float[np.ndarray, " N"],
    seen: Int[np.ndarray, "N K"],
) -> tuple[Bool[np.ndarray, "N K"], Bool[np.ndarray, "N K"]]:
    """Return which other edges run beside each one and turn as it does, and which more sharply.

    ``turn`` is its cosine.
    """
    cosines = turn_cosines(normals, mesh, seen)
    own, other = _along(points, mesh, flat), _along(points, mesh, seen)
    along = dot(other, own[:, None])
    parallel = along * along >= PARALLEL**2 * (dot(other, other) * dot(own, own)[:, None])
    bend, bends = (1 - turn)[:, None], 1 - cosines
    as_far = (bends <= TIMES_ITS_OWN * bend) & (bend <= TIMES_THEIRS * bends)
    same_way = rises(points, normals, mesh, seen) == rises(points, normals, mesh, flat)[:, None]
    ends, own_ends = mesh.edges[seen], mesh.edges[flat][:, None]
    starts, stops = (ends == own_ends).any(axis=-1), (ends == own_ends[..., ::-1]).any(axis=-1)
    goes_on = (starts & (along < 0)) | (stops & (along > 0))
    beside = (seen != flat[:, None]) & parallel & ~goes_on
    return beside & as_far & same_way, beside & (bends > TIMES_ITS_OWN * bend)


def _across(
    mesh: Edges, edges: Int[np.ndarray, "N K"], faces: Int[np.ndarray, "N 1"]
) -> Int[np.ndarray, "N K"]:
    """Return the other face of each interior edge; the face itself where there is none."""
    both = mesh.half_edges[edges] // 3
    other = np.where(both[..., 0] == faces, both[..., 1], both[..., 0])
    return np.where(mesh.edge_class[edges] == EdgeClass.INTERIOR, other, faces)


def _along(
    points: Float[np.ndarray, "V 3"], mesh: Edges, rows: Int[np.ndarray, "..."]
) -> Float[np.ndarray, "... 3"]:
    """Return the vectors along edges."""
    ends = mesh.edges[rows]
    return points[ends[..., 1]] - points[ends[..., 0]]
