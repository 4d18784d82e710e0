"""The corners of the faces that one triangle or quad is split into, whatever mesh it is part of."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Integer

from pns_common.carry.columns import level_topologies
from pns_common.carry.rules import linear
from pns_common.mesh.rows import distinct_rows
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK, LOOP

# The triangles that a quad is cut into.
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


@lru_cache(maxsize=16)
def corner_weights(degree: int, levels: int) -> Float[np.ndarray, "C D"]:
    """Return the weights of a face's corners at the corners of its descendants, which are exact."""
    weights, base, blocks = np.eye(degree), LOOP if degree == 3 else CATMULL_CLARK, Blocks()
    if levels == 0:
        return weights
    topologies = level_topologies(np.arange(degree)[None], degree, levels, base=base)
    for mesh in topologies:
        weights = linear(weights, mesh, base, blocks)
    return weights[base.faces(topologies[-1], blocks, np.int64).reshape(-1)]


@lru_cache(maxsize=32)
def copied_corners(order: tuple[int, ...], levels: int) -> Integer[np.ndarray, " C"]:
    """Return which corner of a face's descendants each of a copy's is.

    The copy's corners are those of the face in another order.
    """
    weights = corner_weights(len(order), levels)
    of_copy = np.empty_like(weights)
    of_copy[:, order] = weights
    return _places(of_copy, weights)


@lru_cache(maxsize=16)
def cut_quads(levels: int) -> Integer[np.ndarray, "T 3"]:
    """Return triangles over the corners of a quad's descendants.

    They are the descendants of its HALVES: all diagonals run the same way.
    """
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    triangles = [corner_weights(3, levels) @ square[half] for half in HALVES]
    corners = corner_weights(4, levels) @ square
    return _places(np.concatenate(triangles), corners).reshape(-1, 3)


def _places(
    asked: Float[np.ndarray, "N K"], rows: Float[np.ndarray, "M K"]
) -> Integer[np.ndarray, " N"]:
    """Return for each row that is asked for where an equal one is."""
    labels = distinct_rows(np.concatenate([rows, asked]))
    place = np.empty(int(labels.max()) + 1, dtype=np.int64)
    place[labels[: len(rows)]] = np.arange(len(rows))
    return place[labels[len(rows) :]]
