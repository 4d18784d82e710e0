"""Refine some faces alone; their neighbours take the new vertices of common edges.

The whole mesh is refined, and of faces that are not chosen only the corners are kept, with the
points of edges that they share with chosen ones. So chosen faces are where they are when all are
refined, and vertices of no chosen face stay where they were.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Integer

from pns_common.errors import ParameterError
from pns_common.topology import Topology

SIDES = 3


@dataclass(frozen=True, eq=False)
class Selected:
    """A refined mesh without what refines faces that were not chosen.

    Attributes:
        faces: (G, 3) its faces, by `vertices`.
        vertices: (W,) refined vertices that are kept, ascending: all old ones, and some new.
        still: (V,) old vertices of no chosen face, which stay where they were.
    """

    faces: Integer[np.ndarray, "G 3"]
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
    topologies: Sequence[Topology],
    refined: Integer[np.ndarray, "C 3"],
    count: int,
) -> Selected:
    """Leave out what refines faces that are not chosen; `refined` are faces of `count` vertices."""
    mesh, segments = topologies[0], 2 ** len(topologies)
    split = np.zeros(len(mesh.edges), dtype=bool)
    split[mesh.face_edges[chosen]] = True
    rest = np.flatnonzero(~chosen)
    sides = split[mesh.face_edges[rest]]
    points = np.full((len(rest), SIDES * segments), -1, dtype=np.int64)
    points[:, :SIDES] = mesh.faces[rest]
    for side in range(SIDES):
        some = np.flatnonzero(sides[:, side])
        ends = mesh.faces[rest[some]][:, [side, (side + 1) % SIDES]].astype(np.int64)
        begin = SIDES + side * (segments - 1)
        points[some, begin : begin + segments - 1] = _along(ends, topologies)[:, 1:-1]
    blocks = [refined.reshape(len(chosen), -1, SIDES)[chosen].reshape(-1, SIDES)]
    owners = [np.repeat(np.flatnonzero(chosen), 4 ** len(topologies))]
    for kind, triangles in enumerate(transitions(segments)):
        own = np.flatnonzero(sides @ [1, 2, 4] == kind)
        blocks.append(points[own][:, triangles].reshape(-1, SIDES))
        owners.append(np.repeat(rest[own], len(triangles)))
    faces = np.concatenate(blocks)[np.argsort(np.concatenate(owners), kind="stable")]
    kept = np.zeros(count, dtype=bool)
    kept[: mesh.vertex_count] = True
    kept[faces] = True
    still = np.ones(mesh.vertex_count, dtype=bool)
    still[mesh.faces[chosen]] = False
    return Selected((np.cumsum(kept) - 1)[faces], np.flatnonzero(kept), still)


def _along(
    ends: Integer[np.ndarray, "N 2"], topologies: Sequence[Topology]
) -> Integer[np.ndarray, "N P"]:
    """Return the refined vertices along edges, both ends among them."""
    points = ends
    for mesh in topologies:
        pairs = np.stack([points[:, :-1], points[:, 1:]], axis=2)
        middles = mesh.vertex_count + mesh.rows_of(pairs.reshape(-1, 2)).reshape(pairs.shape[:2])
        finer = np.empty((len(points), 2 * points.shape[1] - 1), dtype=np.int64)
        finer[:, ::2], finer[:, 1::2] = points, middles
        points = finer
    return points


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
