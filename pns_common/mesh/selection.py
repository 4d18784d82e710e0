"""Refine some faces alone; their neighbours take the new vertices of common edges.

The whole mesh is refined, and of faces that are not chosen only the corners are kept, with the
points of edges that they share with chosen ones. So chosen faces are where they are when all are
refined, and vertices of no chosen face stay where they were.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Integer

from pns_common.errors import ParameterError
from pns_common.mesh.rows import marked
from pns_common.mesh.topology import Topology, following

SIDES = 3


@dataclass(frozen=True, eq=False)
class Selected:
    """A refined mesh without what refines faces that were not chosen.

    Attributes:
        places: (H,) which corner of all refined faces each of its corners is.
        offsets: (G + 1,) where the corners of each of its faces begin.
        corners: (H,) its corners, by `vertices`.
        vertices: (W,) refined vertices that are kept, ascending: all old ones, and some new.
        still: (V,) old vertices of no chosen face, which stay where they were.
    """

    places: Integer[np.ndarray, " H"]
    offsets: Integer[np.ndarray, " G1"]
    corners: Integer[np.ndarray, " H"]
    vertices: Integer[np.ndarray, " W"]
    still: Bool[np.ndarray, " V"]


def chosen_faces(given: Any, count: int) -> Bool[np.ndarray, " F"]:
    """Return which faces an argument names: a mask, or their numbers.

    Raises:
        ParameterError: it is neither, or names no face.
    """
    faces = np.asarray(given)
    expected = f"numbers of faces from 0 to {count - 1}, or {count} of True and False"
    if faces.dtype == bool and faces.shape == (count,):
        chosen = faces
    elif faces.dtype.kind in "iu" and faces.ndim == 1 and ((faces >= 0) & (faces < count)).all():
        chosen = np.zeros(count, dtype=bool)
        chosen[faces] = True
    else:
        raise ParameterError("faces", f"{faces.dtype} of shape {faces.shape}", expected=expected)
    if not chosen.any():
        raise ParameterError("faces", "none", expected=expected)
    return chosen


def select(
    chosen: Bool[np.ndarray, " F"],
    mesh: Topology,
    refined: Integer[np.ndarray, "C N"],
    count: int,
    levels: int,
) -> Selected:
    """Leave out what refines faces that are not chosen.

    Triangles beside chosen ones are cut. Beside quads any face takes the new vertices as corners.

    Args:
        chosen: faces of the control mesh.
        mesh: the control mesh.
        refined: all refined faces, triangles or quads, of ``count`` vertices.
        count, levels: how many vertices these have, and how often faces were split.
    """
    degree, each, every = refined.shape[1], int(4**levels), np.arange(len(mesh.corners))
    picked = chosen[mesh.face_of(every)]
    inner, outer = np.flatnonzero(picked), np.flatnonzero(~picked)
    split = marked(mesh.corner_edges[inner], len(mesh.edges))[mesh.corner_edges[outer]]
    along = _along(outer, following(mesh.offsets)[outer], levels, degree)
    if degree == SIDES:
        places, owner = _cut(along.reshape(-1, SIDES, 2**levels), split.reshape(-1, SIDES))
        owner = outer[SIDES * owner]
    else:
        points = np.ones(along.shape, dtype=bool)
        points[~split, 1:] = False
        places, owner = along[points], np.repeat(outer, points.sum(axis=1))
    counts = np.where(picked, each, np.bincount(owner, minlength=len(picked)))
    where = np.empty(counts.sum(), dtype=np.int64)
    inside = np.repeat(picked, counts)
    where[inside] = np.add.outer(each * inner, np.arange(each)).reshape(-1)
    where[~inside] = places
    offsets = np.arange(0, len(where) + 1, degree)
    if degree != SIDES:
        sides = np.add.reduceat(counts, mesh.offsets[:-1])
        faces = np.where(chosen, sides // degree, 1)
        offsets = np.append(0, np.cumsum(np.repeat(sides // faces, faces)))
    corners = refined.reshape(-1)[where]
    stays = marked(corners, count)
    stays[: mesh.vertex_count] = True
    still = ~marked(mesh.corners[inner], mesh.vertex_count)
    return Selected(where, offsets, (np.cumsum(stays) - 1)[corners], np.flatnonzero(stays), still)


def _along(
    corners: Integer[np.ndarray, " N"],
    followed: Integer[np.ndarray, " N"],
    levels: int,
    degree: int,
) -> Integer[np.ndarray, "N P"]:
    """Return the corners of refined faces along the edges that leave corners, from each on.

    The child of a corner begins there: its first side is the first half of the edge that leaves
    the corner, and its last side the second half of the edge that enters it.
    """
    own, followed = corners[:, None], followed[:, None]
    for _ in range(levels):
        if degree == SIDES:
            own, followed = (4 * (at // SIDES) + at % SIDES for at in (own, followed))
        halves = np.stack([degree * own, degree * followed + degree - 1], axis=2)
        own = halves.reshape(len(own), 2 * own.shape[1])
        followed = own - own % degree + (own + 1) % degree
    return own


def _cut(
    along: Integer[np.ndarray, "N 3 P"], split: Bool[np.ndarray, "N 3"]
) -> tuple[Integer[np.ndarray, " M"], Integer[np.ndarray, " M"]]:
    """Return the corners of the triangles that N triangles are cut into, and of which each is."""
    inner = along[:, :, 1:].reshape(len(along), SIDES * (along.shape[2] - 1))
    points = np.concatenate([along[:, :, 0], inner], axis=1)
    owners, places = list[np.ndarray](), list[np.ndarray]()
    for kind, triangles in enumerate(transitions(along.shape[2])):
        own = np.flatnonzero(split @ [1, 2, 4] == kind)
        places.append(points[own][:, triangles.reshape(-1)].reshape(-1))
        owners.append(np.repeat(own, triangles.size))
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(places)[order], np.concatenate(owners)[order]


@lru_cache(maxsize=8)
def transitions(segments: int) -> tuple[Integer[np.ndarray, "T 3"], ...]:
    """Return the triangles of a face by which of its sides are split; side k is bit k.

    Points 0, 1, 2 are the corners; the `segments` − 1 points of side k, from corner k to the next,
    follow those of the sides before it.
    """
    return tuple(_transition(kind, segments) for kind in range(2**SIDES))


def _transition(kind: int, segments: int) -> Integer[np.ndarray, "T 3"]:
    def points(side: int) -> list[int]:
        begin = SIDES + side * (segments - 1)
        inside = range(begin, begin + segments - 1) if kind >> side & 1 else range(0)
        return [side, *inside, (side + 1) % SIDES]

    if not kind:
        return np.array([[0, 1, 2]])
    first = next(side for side in range(SIDES) if kind >> side & 1)
    apex, (after, before) = (first + 2) % SIDES, (points((first + k) % SIDES) for k in (1, 2))
    fan = [(a, b, apex) for a, b in pairwise(points(first))]
    # The outer triangles of the fan have the other sides, along which they are cut once more.
    b, c = fan[0][1], fan[-1][0]
    begin = [(b, p, q) for p, q in pairwise(before)]
    end = [(c, p, q) for p, q in pairwise(after)]
    return np.array([*begin, *fan[1:-1], *end])
