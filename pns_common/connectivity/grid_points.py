"""Points of split faces, for what follows a mesh's corners and is no position.

F faces are split into a grid of T points each; ``ids`` say which refined vertex each point is.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Int
from numpy.typing import DTypeLike

from pns_common.base.blocks import Blocks

# What has the points of a face: its corners 0, 1, 2, its edges 3, 4, 5, itself.
EDGES, FACE = 3, 6


def index_type(count: int) -> type[np.int32] | type[np.int64]:
    """Return the narrowest type of indices below ``count``: half the memory is half the time."""
    return np.int32 if count <= np.iinfo(np.int32).max else np.int64


def take_points(
    rows: Int[np.ndarray, "F K"], columns: Int[np.ndarray, " T"], dtype: DTypeLike, blocks: Blocks
) -> Int[np.ndarray, "F T"]:
    """Return columns of rows of indices, in a type that can hold them."""
    taken = np.empty((len(rows), len(columns)), dtype=dtype)

    def take(share: slice) -> None:
        taken[share] = np.take(rows[share], columns, axis=1)

    blocks.run(len(rows), take)
    return taken


def number_points(
    corners: Int[np.ndarray, "F 3"],
    on_edges: Int[np.ndarray, "F 3"],
    inside: int,
    owner: Int[np.ndarray, " T"],
    place: Int[np.ndarray, "8 T"],
    blocks: Blocks,
) -> Int[np.ndarray, "F T"]:
    """Return the refined vertex at each point of each face.

    Args:
        corners: the vertices at a face's corners a, b, c.
        on_edges: the first of those on its edges (a, b), (b, c), (c, a).
        inside: the first of those inside faces; as many for each.
        owner: what has each point: a corner (0, 1, 2), an edge (3, 4, 5), the face (6).
        place: which of its owner's points each is, where those edges i run from the higher corner
            to the lower that have bit 2ⁱ in the row's number.
        blocks: how rows are divided.
    """
    in_faces = inside + int((owner == FACE).sum()) * np.arange(len(corners) + 1)
    ids = np.empty((len(corners), len(owner)), dtype=index_type(int(in_faces[-1])))

    def number(rows: slice) -> None:
        first = np.concatenate([corners[rows], on_edges[rows], in_faces[rows, None]], axis=1)
        a, b, c = corners[rows].T
        backwards = 1 * (a > b) + 2 * (b > c) + 4 * (c > a)
        ids[rows] = np.take(first, owner, axis=1) + np.take(place, backwards, axis=0)

    blocks.run(len(corners), number)
    return ids


def move_to_vertices(
    ids: Int[np.ndarray, "F T"], at_points: Int[np.ndarray, "F T"], count: int, blocks: Blocks
) -> Int[np.ndarray, " N"]:
    """Move labels that agree wherever refined vertices do from points to the N vertices."""
    labels = np.empty(count, dtype=at_points.dtype)

    def move(rows: slice) -> None:
        labels[ids[rows]] = at_points[rows]

    blocks.run(len(ids), move)
    return labels


def blend_along(
    values: Float[np.ndarray, "C K"],
    edges: Int[np.ndarray, "E 2"],
    parameters: Float[np.ndarray, " n"],
    blended: Float[np.ndarray, "P K"],
    blocks: Blocks,
) -> None:
    """Write values at the n points of each edge, which lie at ``parameters`` from 0 to 1."""
    along = blended.reshape(len(edges), len(parameters), values.shape[1])
    # One point of all edges after the other: numpy is slow along short rows.
    start, end = (np.take(values, edges[:, side], axis=0) for side in (0, 1))
    for place, t in enumerate(parameters):
        along[:, place] = (1 - t) * start + t * end


def blend_inside(
    values: Float[np.ndarray, "C K"],
    faces: Int[np.ndarray, "F 3"],
    weights: Float[np.ndarray, "n 3"],
    blended: Float[np.ndarray, "P K"],
    blocks: Blocks,
) -> None:
    """Write values at the n points inside each face, in which its corners have ``weights``."""
    inner = blended.reshape(len(faces), len(weights), values.shape[1])
    of_face = [np.take(values, faces[:, k], axis=0) for k in range(3)]
    for place, shares in enumerate(weights):
        inner[:, place] = sum(map(np.multiply, shares, of_face))


def rounded_rows(
    values: Float[np.ndarray, "V K"], rows: Int[np.ndarray, " N"], blocks: Blocks
) -> Float32[np.ndarray, "N K"]:
    """Return rows of values in single precision."""
    return np.take(values, rows, axis=0).astype(np.float32)
