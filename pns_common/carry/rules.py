"""Rules: what one level of the split makes of values at the vertices of a mesh.

Each returns rows of old vertices, then of edges, then of faces where the scheme splits polygons.
Values at corners are values at the vertices of the charts that they form: see ``charts``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Inexact, Shaped

from pns_common.carry.rows import place_middles
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.matrix import subdivision_matrix

Rule = Callable[
    [Shaped[np.ndarray, "V K"], Topology, BaseScheme, Blocks], Shaped[np.ndarray, "W K"]
]
# Sums of weights that differ by rounding are equal.
DIGITS = 12


def smooth(
    values: Float[np.ndarray, "V K"], mesh: Topology, base: BaseScheme, blocks: Blocks
) -> Float[np.ndarray, "W K"]:
    """Apply the scheme's masks, as to positions."""
    return base.place(values, mesh, blocks)


def linear(
    values: Inexact[np.ndarray, "V K"], mesh: Topology, base: BaseScheme, blocks: Blocks
) -> Inexact[np.ndarray, "W K"]:
    """Keep old values; take the middle of each edge and the mean of each polygon's corners."""
    old, new = len(values), len(values) + len(mesh.edges)
    made = np.empty((new + mesh.face_count * base.polygons, values.shape[1]), dtype=values.dtype)
    made[:old] = values
    if values.dtype == np.float64:
        place_middles(values, mesh.edges, made[old:new], blocks)
    else:
        made[old:new] = values[mesh.edges[:, 0]] / 2 + values[mesh.edges[:, 1]] / 2
    if base.polygons:
        sums = np.add.reduceat(values[mesh.corners], mesh.offsets[:-1], axis=0)
        made[new:] = sums / np.diff(mesh.offsets)[:, None]
    return made


def nearest(
    values: Shaped[np.ndarray, "V K"], mesh: Topology, base: BaseScheme, blocks: Blocks
) -> Shaped[np.ndarray, "W K"]:
    """Keep old values; take those of each edge's first end and of each polygon's first corner."""
    parts = [values, values[mesh.edges[:, 0]]]
    if base.polygons:
        parts.append(values[mesh.corners[mesh.offsets[:-1]]])
    return np.concatenate(parts)


def old(
    values: Shaped[np.ndarray, "V K"], mesh: Topology, base: BaseScheme, blocks: Blocks
) -> Shaped[np.ndarray, "W K"]:
    """Keep old values; new vertices have zeros."""
    count = len(mesh.edges) + (mesh.face_count if base.polygons else 0)
    return np.concatenate([values, np.zeros((count, values.shape[1]), dtype=values.dtype)])


def vote(
    values: Shaped[np.ndarray, "V K"], mesh: Topology, base: BaseScheme, blocks: Blocks
) -> Shaped[np.ndarray, "W K"]:
    """Keep old values; a new vertex has that of most of its parents.

    Parents vote with the weight that the scheme's mask gives them; of equals, the parent of the
    largest weight wins, and of these that of the lowest number.
    """
    masks = subdivision_matrix([mesh], base)
    new = masks.rows >= len(values)
    row, parent, weight = masks.rows[new], masks.columns[new], masks.weights[new]
    _, which = np.unique(values, axis=0, return_inverse=True)
    candidate = row * np.int64(len(values)) + which.reshape(-1)[parent]
    _, candidate = np.unique(candidate, return_inverse=True)
    votes = np.round(np.bincount(candidate, weight)[candidate], DIGITS)
    order = np.lexsort([parent, -np.round(weight, DIGITS), -votes, row])
    first = np.unique(row[order], return_index=True)[1]
    return np.concatenate([values, values[parent[order[first]]]])
