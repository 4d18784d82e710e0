"""The split of polygons into quads, and its edges by arithmetic.

The quad of corner h of face f is made of four vertices: its own, that of the edge that leaves it,
the face's, and that of the edge that enters it. A parent edge has two halves. Each corner has an
inner edge, from the vertex of the edge that leaves it to the face's. Over the quads of a face of n
corners they appear in this order, halves only in the first face that they are on:

    leaving₀ inner₀ innerₙ₋₁ entering₀    leaving₁ inner₁ entering₁  …    leavingₙ₋₁ enteringₙ₋₁

This holds where no face names a vertex twice.
"""

from __future__ import annotations

import numpy as np

from pns_common.kernels import (
    b1_1d,
    f8_1d,
    f8_2d,
    i1_1d,
    i4_1d,
    i4_2d,
    i8_2d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.children import mark_fold, moved, squared_chord
from pns_common.kernels.connectivity import INTERIOR, following_corner, opened_before
from pns_common.kernels.vectors import NO_AREA, cross, difference, dot, norm, over, row

QUAD = 4


@kernel
def split_faces(
    corners: u4_1d,
    offsets: i4_1d,
    corner_edges: u4_1d,
    vertex_count: int,
    face_vertex: int,
    begin: int,
    end: int,
    to: i8_2d | u4_2d,
):
    """Write the quads of the corners of faces begin … end − 1; ``face_vertex`` is face 0's."""
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        for h in range(first, stop):
            to[h, 0], to[h, 1] = corners[h], vertex_count + corner_edges[h]
            to[h, 2] = face_vertex + f
            to[h, 3] = vertex_count + corner_edges[h - 1 if h > first else stop - 1]


@kernel
def number_halves(
    corners: u4_1d,
    offsets: i4_1d,
    corner_edges: u4_1d,
    edges: u4_2d,
    half_edges: i4_2d,
    begin: int,
    end: int,
    halves: u4_2d,
):
    """Assign numbers to both halves of the edges that first appear in faces begin … end − 1.

    ``halves`` (E, 2), out: the half at the lower endpoint, and at the higher.
    """
    following = offsets[begin] + 2 * opened_before(half_edges, offsets[begin])
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        for h in range(first, stop):
            before = h - 1 if h > first else stop - 1
            leaving, entering, vertex = corner_edges[h], corner_edges[before], corners[h]
            if half_edges[leaving, 0] == h:
                halves[leaving, 0 if vertex == edges[leaving, 0] else 1] = following
                following += 1
            following += _inner_edges(h, first, stop)
            if half_edges[entering, 0] == before:
                halves[entering, 0 if vertex == edges[entering, 0] else 1] = following
                following += 1


@inlined
def _inner_edges(h, first, stop):
    """Return how many inner edges appear first in the quad of corner h."""
    return 2 if h == first else 1 if h + 1 < stop else 0


@inlined
def _half_at(h, vertex, corners, offsets, face_of_corner):
    """Return the half of a parent's half-edge that is at ``vertex``."""
    if corners[h] == vertex:
        return QUAD * h
    return QUAD * following_corner(h, offsets, face_of_corner) + 3


@inlined
def _write_half(e, vertex, child, parent, vertex_count, half_edges, edge_class, to):
    """Write a half of edge e: as many half-edges as e, of e's class."""
    corners, offsets, face_of_corner = parent
    to_edges, to_half_edges, to_class = to
    to_edges[child, 0], to_edges[child, 1] = vertex, vertex_count + e
    first, second = half_edges[e, 0], half_edges[e, 1]
    to_half_edges[child, 0] = _half_at(first, vertex, corners, offsets, face_of_corner)
    to_half_edges[child, 1] = (
        second if second < 0 else _half_at(second, vertex, corners, offsets, face_of_corner)
    )
    to_class[child] = edge_class[e]


@kernel
def split_edges(
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    edges: u4_2d,
    halves: u4_2d,
    vertex_count: int,
    begin: int,
    end: int,
    to_corner_edges: u4_2d,
    to_edges: u4_2d,
    to_half_edges: i4_2d,
    to_class: i1_1d,
):
    """Write the edges of the quads of faces begin … end − 1."""
    parent, to = (corners, offsets, face_of_corner), (to_edges, to_half_edges, to_class)
    face_vertex = vertex_count + edges.shape[0]
    following = offsets[begin] + 2 * opened_before(half_edges, offsets[begin])
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        inner_before, inner_of_last = -1, -1
        for h in range(first, stop):
            before = h - 1 if h > first else stop - 1
            leaving, entering, vertex = corner_edges[h], corner_edges[before], corners[h]
            out_of = halves[leaving, 0 if vertex == edges[leaving, 0] else 1]
            into = halves[entering, 0 if vertex == edges[entering, 0] else 1]
            if half_edges[leaving, 0] == h:
                _write_half(
                    leaving, vertex, out_of, parent, vertex_count, half_edges, edge_class, to
                )
                following += 1
            inner = following if h + 1 < stop else inner_of_last
            if h == first:
                inner_of_last = inner_before = following + 1
                to_half_edges[inner_of_last, 0] = QUAD * first + 2
                to_half_edges[inner_of_last, 1] = QUAD * (stop - 1) + 1
            if h + 1 < stop:
                to_half_edges[inner, 0] = QUAD * h + 1
                to_half_edges[inner, 1] = QUAD * (h + 1) + 2
            following += _inner_edges(h, first, stop)
            to_edges[inner, 0], to_edges[inner, 1] = vertex_count + leaving, face_vertex + f
            to_class[inner] = INTERIOR
            if half_edges[entering, 0] == before:
                _write_half(
                    entering, vertex, into, parent, vertex_count, half_edges, edge_class, to
                )
                following += 1
            to_corner_edges[h, 0], to_corner_edges[h, 1] = out_of, inner
            to_corner_edges[h, 2], to_corner_edges[h, 3] = inner_before, into
            inner_before = inner


# --- measurements of the quads --------------------------------------------------------------------


@inlined
def quad_normal(p, q, r, s):
    """Return the unit normal of a quad p q r s: that of its area vector; 0 without area."""
    u, v = difference(r, p), difference(s, q)
    vector = cross(u, v)
    shortest = NO_AREA * (dot(u, u) + dot(v, v))
    if dot(vector, vector) > shortest * shortest:
        return over(vector, norm(vector))
    return 0.0, 0.0, 0.0


@kernel
def mark_folds(
    base: f8_2d,
    displacement: f8_2d,
    scale: f8_1d,
    shared: b1_1d,
    changed: b1_1d,
    cosine: float,
    corners: u4_1d,
    offsets: i4_1d,
    corner_edges: u4_1d,
    vertex_count: int,
    face_vertex: int,
    begin: int,
    end: int,
    to: b1_1d,
):
    """Mark corners of the quads of faces begin … end − 1 that fold at one of their four corners.

    At each corner the triangle of it and its neighbours is tested, as ``children.mark_folds`` tests
    triangles; arguments are as there.
    """
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        for h in range(first, stop):
            # Of one type: the corners are looped over.
            a, b, c = np.int64(corners[h]), vertex_count + corner_edges[h], face_vertex + f
            d = vertex_count + corner_edges[h - 1 if h > first else stop - 1]
            if len(changed) and not (changed[a] or changed[b] or changed[c] or changed[d]):
                continue
            p, q = moved(base, displacement, scale, a), moved(base, displacement, scale, b)
            r, s = moved(base, displacement, scale, c), moved(base, displacement, scale, d)
            mark_fold(s, p, q, d, a, b, scale, shared, cosine, to)
            mark_fold(p, q, r, a, b, c, scale, shared, cosine, to)
            mark_fold(q, r, s, b, c, d, scale, shared, cosine, to)
            mark_fold(r, s, p, c, d, a, scale, shared, cosine, to)


@kernel
def child_normals(
    points: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    corner_edges: u4_1d,
    vertex_count: int,
    face_vertex: int,
    begin: int,
    end: int,
    normals: f8_2d,
):
    """Write the unit normals of the quads of faces begin … end − 1."""
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        for h in range(first, stop):
            before = corner_edges[h - 1 if h > first else stop - 1]
            normal = quad_normal(
                row(points, corners[h]),
                row(points, vertex_count + corner_edges[h]),
                row(points, face_vertex + f),
                row(points, vertex_count + before),
            )
            for k in range(3):
                normals[h, k] = normal[k]


@kernel
def largest_chord_inside(normals: f8_2d, offsets: i4_1d, begin: int, end: int):
    """Return the largest squared chord between neighbouring quads of faces begin … end − 1."""
    largest = 0.0
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        for h in range(first, stop):
            before = h - 1 if h > first else stop - 1
            largest = max(largest, squared_chord(normals, before, h))
    return largest


@kernel
def largest_chord_across(
    normals: f8_2d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    begin: int,
    end: int,
):
    """Return the largest squared chord across the halves of interior edges begin … end − 1."""
    largest = 0.0
    for e in range(max(begin, 0), end):
        if edge_class[e] == INTERIOR:
            there, back = half_edges[e, 0], half_edges[e, 1]
            beyond = following_corner(there, offsets, face_of_corner)
            largest = max(
                largest,
                squared_chord(normals, there, following_corner(back, offsets, face_of_corner)),
                squared_chord(normals, beyond, back),
            )
    return largest
