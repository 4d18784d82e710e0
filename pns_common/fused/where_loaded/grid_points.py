"""Points of split faces, by kernels where they are loaded.

Each function gives what that of ``pns_common.connectivity.grid_points`` does, bit for bit, in a
third of the time or less. The kernels are not loaded for this.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Int
from numpy.typing import DTypeLike

from pns_common.base.blocks import Blocks
from pns_common.connectivity import grid_points as arrays
from pns_common.fused import LARGEST_INDEX, kernels_loaded
from pns_common.fused.kernels import grid_points as kernels
from pns_common.fused.kernels.compiled import ROWS

_TAKE = {np.dtype(np.int32): kernels.take_columns, np.dtype(np.int64): kernels.take_columns_long}


def take_points(
    rows: Int[np.ndarray, "F K"], columns: Int[np.ndarray, " T"], dtype: DTypeLike, blocks: Blocks
) -> Int[np.ndarray, "F T"]:
    """Return columns of rows of indices, in a type that can hold them."""
    if not (kernels_loaded() and dtype == np.int32 and rows.dtype in _TAKE):
        return arrays.take_points(rows, columns, dtype, blocks)
    kernel, rows, columns = _TAKE[rows.dtype], np.ascontiguousarray(rows), _narrow(columns)
    taken = np.empty((len(rows), len(columns)), dtype=np.int32)
    blocks.run(len(rows), kernel.over(rows, columns, ROWS, taken))
    return taken


def number_points(
    corners: Int[np.ndarray, "F 3"],
    on_edges: Int[np.ndarray, "F 3"],
    inside: int,
    owner: Int[np.ndarray, " T"],
    place: Int[np.ndarray, "8 T"],
    blocks: Blocks,
) -> Int[np.ndarray, "F T"]:
    """Return the refined vertex at each point of each face; arguments as the arrays' have them."""
    count = int((owner == arrays.FACE).sum())
    if not _served(inside + count * len(corners)):
        return arrays.number_points(corners, on_edges, inside, owner, place, blocks)
    ids = np.empty((len(corners), len(owner)), dtype=np.int32)
    faces = _narrow(corners), _narrow(on_edges), inside, count
    grid = _narrow(owner), _narrow(place)
    blocks.run(len(corners), kernels.number_points.over(*faces, *grid, ROWS, ids))
    return ids


def move_to_vertices(
    ids: Int[np.ndarray, "F T"], at_points: Int[np.ndarray, "F T"], count: int, blocks: Blocks
) -> Int[np.ndarray, " N"]:
    """Move labels that agree wherever refined vertices do from points to the N vertices."""
    if not (_served(count) and ids.dtype == at_points.dtype == np.int32):
        return arrays.move_to_vertices(ids, at_points, count, blocks)
    labels = np.empty(count, dtype=np.int32)
    points = np.ascontiguousarray(ids), np.ascontiguousarray(at_points)
    blocks.run(len(ids), kernels.move_to_vertices.over(*points, ROWS, labels))
    return labels


def blend_along(
    values: Float[np.ndarray, "C K"],
    edges: Int[np.ndarray, "E 2"],
    parameters: Float[np.ndarray, " n"],
    blended: Float[np.ndarray, "P K"],
    blocks: Blocks,
) -> None:
    """Write values at the n points of each edge, which lie at ``parameters`` from 0 to 1."""
    if not _served(len(blended)):
        arrays.blend_along(values, edges, parameters, blended, blocks)
        return
    given = np.ascontiguousarray(values), _narrow(edges), parameters
    blocks.run(len(edges), kernels.blend_along.over(*given, ROWS, blended))


def blend_inside(
    values: Float[np.ndarray, "C K"],
    faces: Int[np.ndarray, "F 3"],
    weights: Float[np.ndarray, "n 3"],
    blended: Float[np.ndarray, "P K"],
    blocks: Blocks,
) -> None:
    """Write values at the n points inside each face, in which its corners have ``weights``."""
    if not _served(len(blended)):
        arrays.blend_inside(values, faces, weights, blended, blocks)
        return
    given = np.ascontiguousarray(values), _narrow(faces), weights
    blocks.run(len(faces), kernels.blend_inside.over(*given, ROWS, blended))


def rounded_rows(
    values: Float[np.ndarray, "V K"], rows: Int[np.ndarray, " N"], blocks: Blocks
) -> Float32[np.ndarray, "N K"]:
    """Return rows of values in single precision."""
    if not (_served(max(len(values), len(rows))) and values.dtype == np.float64):
        return arrays.rounded_rows(values, rows, blocks)
    rounded = np.empty((len(rows), values.shape[1]), dtype=np.float32)
    given = np.ascontiguousarray(values), _narrow(rows)
    blocks.run(len(rows), kernels.round_rows.over(*given, ROWS, rounded))
    return rounded


def _served(count: int) -> bool:
    """Return whether kernels are loaded, and can number so many."""
    return kernels_loaded() and count <= LARGEST_INDEX


def _narrow(indices: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
    return np.ascontiguousarray(indices, dtype=np.int32)
