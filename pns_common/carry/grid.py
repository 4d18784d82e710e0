"""Points of split faces, for what follows a mesh's corners and is no position.

F triangles are split into a grid of T points each; ``ids`` say which refined vertex each point is.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Integer, Real
from numpy.typing import DTypeLike

from pns_common.kernels import grid as kernels
from pns_common.parallel import Blocks

# A point's owner: corners 0, 1, 2, edges 3, 4, 5, the face itself.
EDGES, FACE = kernels.EDGES, kernels.FACE


def index_type(count: int) -> type[np.int32] | type[np.int64]:
    """Return the narrowest type of indices below ``count``: half the memory is half the time."""
    return np.int32 if count <= np.iinfo(np.int32).max else np.int64


def take_points(
    rows: Integer[np.ndarray, "F K"],
    columns: Integer[np.ndarray, " T"],
    dtype: DTypeLike,
    blocks: Blocks,
) -> Integer[np.ndarray, "F T"]:
    """Return columns of rows of indices, in a type that can hold them."""
    given = np.ascontiguousarray(rows), np.ascontiguousarray(columns)
    taken = np.empty((len(rows), len(columns)), dtype=dtype)
    blocks.run(len(rows), lambda begin, end: kernels.take_columns(*given, begin, end, taken))
    return taken


def number_points(
    corners: Integer[np.ndarray, "F 3"],
    on_edges: Integer[np.ndarray, "F 3"],
    inside: int,
    owner: Integer[np.ndarray, " T"],
    place: Integer[np.ndarray, "8 T"],
    blocks: Blocks,
) -> Integer[np.ndarray, "F T"]:
    """Return the refined vertex at each point of each face.

    Args:
        corners: the vertices at a face's corners a, b, c.
        on_edges: the first vertices on its edges (a, b), (b, c), (c, a).
        inside: the first vertex inside a face; as many for each face.
        owner: the owner of each point: a corner (0, 1, 2), an edge (3, 4, 5), the face (6).
        place: which of its owner's points each is, where those edges i run from the higher corner
            to the lower that have bit 2ⁱ in the row's number.
        blocks: how rows are divided.
    """
    count = int((owner == FACE).sum())
    ids = np.empty((len(corners), len(owner)), dtype=index_type(inside + count * len(corners)))
    faces = np.ascontiguousarray(corners), np.ascontiguousarray(on_edges), inside, count
    blocks.run(
        len(corners),
        lambda begin, end: kernels.number_points(*faces, owner, place, begin, end, ids),
    )
    return ids


def move_to_vertices(
    ids: Integer[np.ndarray, "F T"],
    at_points: Integer[np.ndarray, "F T"],
    count: int,
    blocks: Blocks,
) -> Integer[np.ndarray, " N"]:
    """Move labels from points to the N vertices; points of one vertex have one label."""
    labels = np.empty(count, dtype=at_points.dtype)
    given = np.ascontiguousarray(ids), np.ascontiguousarray(at_points)
    blocks.run(len(ids), lambda begin, end: kernels.move_to_vertices(*given, begin, end, labels))
    return labels


def blend_along(
    values: Float[np.ndarray, "C K"],
    edges: Integer[np.ndarray, "E 2"],
    parameters: Float[np.ndarray, " n"],
    blended: Float[np.ndarray, "P K"],
    blocks: Blocks,
) -> None:
    """Write values at the n points of each edge, which lie at ``parameters`` from 0 to 1."""
    given = np.ascontiguousarray(values), np.ascontiguousarray(edges), parameters
    blocks.run(len(edges), lambda begin, end: kernels.blend_along(*given, begin, end, blended))


def blend_inside(
    values: Float[np.ndarray, "C K"],
    faces: Integer[np.ndarray, "F 3"],
    weights: Float[np.ndarray, "n 3"],
    blended: Float[np.ndarray, "P K"],
    blocks: Blocks,
) -> None:
    """Write values at the n points inside each face, in which its corners have ``weights``."""
    given = np.ascontiguousarray(values), np.ascontiguousarray(faces), weights
    blocks.run(len(faces), lambda begin, end: kernels.blend_inside(*given, begin, end, blended))


def rounded_rows(
    values: Real[np.ndarray, "V K"], rows: Integer[np.ndarray, " N"], blocks: Blocks
) -> Float32[np.ndarray, "N K"]:
    """Return rows of values in single precision."""
    rounded = np.empty((len(rows), values.shape[1]), dtype=np.float32)
    given = np.ascontiguousarray(values), np.ascontiguousarray(rows)
    blocks.run(len(rows), lambda begin, end: kernels.round_rows(*given, begin, end, rounded))
    return rounded
