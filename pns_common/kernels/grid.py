"""Splits of triangles into a grid of T points each, for what follows a mesh's corners."""

from __future__ import annotations

from pns_common.kernels import f4_2d, f8_1d, f8_2d, i4_1d, i4_2d, i8_1d, i8_2d, kernel, u4_2d

# A point's owner: corners 0 … 2, edges 3 … 5, the face itself.
EDGES, FACE = 3, 6


@kernel
def take_columns(rows: i4_2d | i8_2d, columns: i8_1d, begin: int, end: int, taken: i4_2d):
    """Write some columns of rows begin … end − 1."""
    for r in range(begin, end):
        for k in range(columns.shape[0]):
            taken[r, k] = rows[r, columns[k]]


@kernel
def number_points(
    corners: i8_2d,
    on_edges: i8_2d,
    inside: int,
    count: int,
    owner: i8_1d,
    place: i8_2d,
    begin: int,
    end: int,
    ids: i4_2d,
):
    """Write the vertices at the points of faces begin … end − 1.

    Args:
        corners: (F, 3) the vertices at a face's corners a, b, c.
        on_edges: (F, 3) the first vertices on its edges (a, b), (b, c), (c, a).
        inside: the first vertex inside a face; each has ``count`` of them.
        owner: (T,) the owner of each point.
        place: (8, T) which of its owner's points each is, where those edges i run from the higher
            corner to the lower that have bit 2ⁱ in the row's number.
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
def move_to_vertices(
    ids: i4_2d | i8_2d, at_points: i4_2d | i8_2d, begin: int, end: int, labels: i4_1d | i8_1d
):
    """Write the labels of the points of faces begin … end − 1 to their vertices."""
    for f in range(begin, end):
        for t in range(ids.shape[1]):
            labels[ids[f, t]] = at_points[f, t]


@kernel
def blend_along(
    values: f8_2d, edges: i8_2d | u4_2d, parameters: f8_1d, begin: int, end: int, blended: f8_2d
):
    """Blend values at the points of edges begin … end − 1, from their first corner to their second.

    Args:
        parameters: (n,) where the points of an edge lie, from 0 to 1.
        blended: (E n, K), out.
    """
    for e in range(begin, end):
        a, b = edges[e, 0], edges[e, 1]
        for i in range(parameters.shape[0]):
            t, row = parameters[i], e * parameters.shape[0] + i
            for k in range(values.shape[1]):
                blended[row, k] = (1 - t) * values[a, k] + t * values[b, k]


@kernel
def blend_inside(values: f8_2d, faces: i8_2d, weights: f8_2d, begin: int, end: int, blended: f8_2d):
    """Blend values at the points inside faces begin … end − 1.

    Args:
        weights: (n, 3) weights of a face's corners at its points.
        blended: (F n, K), out.
    """
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for i in range(weights.shape[0]):
            u, v, w = weights[i, 0], weights[i, 1], weights[i, 2]
            row = f * weights.shape[0] + i
            for k in range(values.shape[1]):
                # From 0 on, so that no zero is negative.
                blended[row, k] = 0.0 + u * values[a, k] + v * values[b, k] + w * values[c, k]


@kernel
def round_rows(values: f8_2d, rows: i4_1d | i8_1d, begin: int, end: int, rounded: f4_2d):
    """Write rows begin … end − 1 of ``rows``, in single precision."""
    for r in range(begin, end):
        for k in range(values.shape[1]):
            rounded[r, k] = values[rows[r], k]
