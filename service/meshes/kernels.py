"""Compiled loops over refined corners, skins and tangents.

A loop takes `begin` and `end` and writes its own rows, so that threads can share the work and the
result does not depend on how they do. Compilation happens at the first call and is cached.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit  # pyright: ignore[reportMissingTypeStubs]
from numpy.typing import DTypeLike

from pns_common.base.blocks import Blocks, available_threads

kernel: Any = njit(cache=True, nogil=True, error_model="numpy")

# Rows of a block of work.
ROWS = 2**14
# Owners of the points of a split face: corners 0 … 2, edges 3 … 5, the face.
EDGES, FACE = 3, 6
# A sum of unit normals times angles below this has no direction.
NO_DIRECTION = 1e-9


def in_blocks(count: int, loop: Any, *arguments: Any, rows: int = ROWS) -> None:
    """Call `loop(begin, end, *arguments)` for blocks of `count` rows, on all processors."""
    Blocks(available_threads(), rows).run(
        count, lambda block: loop(block.start, block.stop, *arguments)
    )


def index_type(count: int) -> DTypeLike:
    """Return the narrowest type of indices below `count`."""
    return np.int32 if count <= np.iinfo(np.int32).max else np.int64


@kernel
def take_columns(begin, end, rows, columns, taken):
    """Copy some columns of rows."""
    for r in range(begin, end):
        for k in range(columns.shape[0]):
            taken[r, k] = rows[r, columns[k]]


@kernel
def number_points(begin, end, corners, on_edges, inside, count, owner, place, ids):
    """Write the vertices at the points of split faces.

    Args:
        begin, end: faces.
        corners: (F, 3) vertices at the corners a, b, c.
        on_edges: (F, 3) first vertices on the edges (a, b), (b, c), (c, a).
        inside: first vertex inside a face; each face has `count`.
        owner: (T,) owner of each point: a corner, an edge, or the face.
        place: (8, T) which of its owner's points each is. Bit i of the row is set if edge i runs
            from the higher corner to the lower.
        ids: (F, T), out.
    """
    for f in range(begin, end):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        row = (1 if a > b else 0) + (2 if b > c else 0) + (4 if c > a else 0)
        for t in range(owner.shape[0]):
            kind = owner[t]
            if kind < EDGES:
                ids[f, t] = corners[f, kind]
            elif kind < FACE:
                ids[f, t] = on_edges[f, kind - EDGES] + place[row, t]
            else:
                ids[f, t] = inside + count * f + place[row, t]


@kernel
def move_to_vertices(begin, end, ids, at_points, labels):
    """Write labels at the points of faces to their vertices (N,)."""
    for f in range(begin, end):
        for t in range(ids.shape[1]):
            labels[ids[f, t]] = at_points[f, t]


@kernel
def blend_along(begin, end, values, edges, parameters, blended):
    """Blend values (C, K) at the points of edges, which lie at parameters from 0 to 1."""
    for e in range(begin, end):
        a, b = edges[e, 0], edges[e, 1]
        for i in range(parameters.shape[0]):
            t, row = parameters[i], e * parameters.shape[0] + i
            for k in range(values.shape[1]):
                blended[row, k] = (1 - t) * values[a, k] + t * values[b, k]


@kernel
def blend_inside(begin, end, values, faces, weights, blended):
    """Blend values (C, K) at the points inside faces; `weights` (n, 3) are those of the corners."""
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for i in range(weights.shape[0]):
            u, v, w = weights[i, 0], weights[i, 1], weights[i, 2]
            row = f * weights.shape[0] + i
            for k in range(values.shape[1]):
                # Starting from 0 avoids negative zeros.
                blended[row, k] = 0.0 + u * values[a, k] + v * values[b, k] + w * values[c, k]


@kernel
def round_rows(begin, end, values, rows, rounded):
    """Copy rows of values in single precision."""
    for r in range(begin, end):
        for k in range(values.shape[1]):
            rounded[r, k] = values[rows[r], k]


@kernel
def keep_heaviest(begin, end, columns, names, kept_names, kept, lost):
    """Insert columns (N, C) with `names` (C,) into the slots (N, K) of each row, heaviest first.

    Weight without a slot is added to `lost` (N,). Of equal weights, the earlier one stays first.
    """
    last = kept.shape[1] - 1
    for r in range(begin, end):
        for k in range(columns.shape[1]):
            weight = columns[r, k]
            if not weight > 0:
                continue
            if weight > kept[r, last]:
                lost[r] += kept[r, last]
                slot = last
                while slot > 0 and weight > kept[r, slot - 1]:
                    kept[r, slot] = kept[r, slot - 1]
                    kept_names[r, slot] = kept_names[r, slot - 1]
                    slot -= 1
                kept[r, slot], kept_names[r, slot] = weight, names[k]
            else:
                lost[r] += weight


@kernel
def scale_rows(begin, end, weights):
    """Scale rows of weights so that each sums to 1; rows of zeros stay."""
    for r in range(begin, end):
        total = weights[r].sum()
        total = total if total > 0 else 1.0
        for k in range(weights.shape[1]):
            weights[r, k] /= total


@kernel
def whole_units(begin, end, weights, total_units, units):
    """Round rows of weights to integers that sum to `total_units`: largest remainders go up.

    Rows of zeros stay.
    """
    count = weights.shape[1]
    below = np.empty(count)
    for r in range(begin, end):
        total = weights[r].sum()
        missing = total_units if total > 0 else 0
        for k in range(count):
            exact = total_units * weights[r, k] / (total if total > 0 else 1.0)
            down = math.floor(exact)
            below[k], units[r, k] = down - exact, down
            missing -= down
        for k in range(count):
            place = 0
            for other in range(k):
                place += below[other] <= below[k]
            for other in range(k + 1, count):
                place += below[other] < below[k]
            units[r, k] += place < missing


@kernel
def flattened_axis(x, y, z):
    """Return the projection onto a normal's plane of the axis that is farthest from the normal."""
    i, j, k = 1.0, 0.0, 0.0
    if abs(y) < abs(x):
        i, j = 0.0, 1.0
    if abs(z) < min(abs(x), abs(y)):
        i, j, k = 0.0, 0.0, 1.0
    inner = i * x + j * y + k * z
    return i - inner * x, j - inner * y, k - inner * z


@kernel
def perpendicular_tangents(begin, end, tangents, normals, made):
    """Write the unit projections of tangents onto the planes of unit normals.

    A tangent without a projection becomes that of an axis.
    """
    for r in range(begin, end):
        i, j, k = tangents[r, 0], tangents[r, 1], tangents[r, 2]
        x, y, z = normals[r, 0], normals[r, 1], normals[r, 2]
        inner = i * x + j * y + k * z
        u, v, w = i - inner * x, j - inner * y, k - inner * z
        length = math.sqrt(u * u + v * v + w * w)
        if length <= NO_DIRECTION * max(math.sqrt(i * i + j * j + k * k), NO_DIRECTION):
            u, v, w = flattened_axis(x, y, z)
            length = math.sqrt(u * u + v * v + w * w)
        length = length if length > 0 else math.inf
        made[r, 0], made[r, 1], made[r, 2] = u / length, v / length, w / length


@kernel
def join(fans, g, h):
    """Unite the sets of two corners; the least corner represents a set."""
    while fans[g] != g:
        fans[g] = fans[fans[g]]
        g = fans[g]
    while fans[h] != h:
        fans[h] = fans[fans[h]]
        h = fans[h]
    if g < h:
        fans[h] = g
    else:
        fans[g] = h


@kernel
def following(h):
    """Return the corner after corner h of its triangle."""
    return h + 1 if h % 3 < 2 else h - 2


@kernel
def join_corners(half_edges, fans):
    """Write the fan of each corner (3 F,), numbered by first appearance.

    Across each edge, given by its two half-edges, the corners at both ends are joined.
    """
    for h in range(fans.shape[0]):
        fans[h] = h
    for r in range(half_edges.shape[0]):
        there, back = half_edges[r, 0], half_edges[r, 1]
        join(fans, there, following(back))
        join(fans, following(there), back)
    # A corner names an earlier one, which is numbered by then, or is the first of its fan.
    count = 0
    for h in range(fans.shape[0]):
        if fans[h] == h:
            fans[h] = count
            count += 1
        else:
            fans[h] = fans[fans[h]]
