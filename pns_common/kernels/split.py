"""The splits of faces, triangles in four or each corner into a quad, and their edges by arithmetic.

A parent edge has two halves. A triangle becomes (a, ab, ca), (b, bc, ab), (c, ca, bc) and
(ab, bc, ca), with three edges inside it. Over these faces they appear in this order:

    a–ab  ab–ca  ca–a    b–bc  bc–ab  ab–b    c–ca  ca–bc  bc–c

The quad of corner h of face f is made of four vertices: its own, that of the edge that leaves it,
the face's, and that of the edge that enters it. Each corner has an inner edge, from the vertex of
the edge that leaves it to the face's. Over the quads of a face of n corners they appear so:

    leaving₀ inner₀ innerₙ₋₁ entering₀    leaving₁ inner₁ entering₁  …    leavingₙ₋₁ enteringₙ₋₁

Halves of an edge appear in the first face that it is on alone. This holds where no face names a
vertex twice and no two triangles have the same three.
"""

from __future__ import annotations

from pns_common.kernels import Connectivity, i1_1d, i4_2d, i8_2d, inlined, kernel, u4_2d
from pns_common.kernels.connectivity import INTERIOR, following_corner, triangle_of

QUAD = 4


@kernel
def split_triangles(begin: int, end: int, mesh: Connectivity, to: i8_2d | u4_2d):
    """Write the children 4 f … 4 f + 3 of triangles begin … end − 1."""
    for f in range(max(begin, 0), end):
        for i in range(3):
            before = 3 * f + (i - 1 if i > 0 else 2)
            middle = mesh.vertex_count + mesh.corner_edges[3 * f + i]
            to[4 * f + i, 0] = mesh.corners[3 * f + i]
            to[4 * f + i, 1] = middle
            to[4 * f + i, 2] = mesh.vertex_count + mesh.corner_edges[before]
            to[4 * f + 3, i] = middle


@kernel
def split_into_quads(begin: int, end: int, mesh: Connectivity, to: i8_2d | u4_2d):
    """Write the quads of the corners of faces begin … end − 1."""
    count = mesh.vertex_count
    for f in range(max(begin, 0), end):
        first, stop = mesh.offsets[f], mesh.offsets[f + 1]
        for h in range(first, stop):
            to[h, 0], to[h, 1] = mesh.corners[h], count + mesh.corner_edges[h]
            to[h, 2] = count + mesh.edges.shape[0] + f
            to[h, 3] = count + mesh.corner_edges[h - 1 if h > first else stop - 1]


@inlined
def _opened_before(mesh, corner):
    """Count the edges that first appear before a corner; first half-edges ascend."""
    least, most = 0, mesh.half_edges.shape[0]
    while least < most:
        middle = (least + most) // 2
        if mesh.half_edges[middle, 0] < corner:
            least = middle + 1
        else:
            most = middle
    return least


@inlined
def _inner_edges(h, first, stop):
    """Return how many inner edges appear first in the quad of corner h."""
    return 2 if h == first else 1 if h + 1 < stop else 0


@inlined
def _end_of(mesh, e, vertex):
    """Return which end of an edge a vertex is."""
    return 0 if vertex == mesh.edges[e, 0] else 1


@inlined
def _number_at(mesh, h, before, inner, halves, following):
    """Assign numbers at corner h, whose child has ``inner`` new inner edges; return the next."""
    leaving, entering, vertex = mesh.corner_edges[h], mesh.corner_edges[before], mesh.corners[h]
    if mesh.half_edges[leaving, 0] == h:
        halves[leaving, _end_of(mesh, leaving, vertex)] = following
        following += 1
    following += inner
    if mesh.half_edges[entering, 0] == before:
        halves[entering, _end_of(mesh, entering, vertex)] = following
        following += 1
    return following


@kernel
def number_halves(begin: int, end: int, mesh: Connectivity, quads: bool, halves: u4_2d):
    """Assign numbers to both halves of the edges that first appear in faces begin … end − 1.

    ``quads``: whether corners become quads. ``halves`` (E, 2), out: the half at the lower endpoint,
    and at the higher.
    """
    following = mesh.offsets[begin] + 2 * _opened_before(mesh, mesh.offsets[begin])
    for f in range(max(begin, 0), end):
        if quads:
            first, stop = mesh.offsets[f], mesh.offsets[f + 1]
            for h in range(first, stop):
                before, inner = h - 1 if h > first else stop - 1, _inner_edges(h, first, stop)
                following = _number_at(mesh, h, before, inner, halves, following)
        else:
            for i in range(3):
                before = 3 * f + (i - 1 if i > 0 else 2)
                following = _number_at(mesh, 3 * f + i, before, 1, halves, following)


@inlined
def _half_in_triangles(mesh, h, vertex):
    """Return the half of a triangle's half-edge that is at ``vertex``."""
    f = triangle_of(h)
    i = h - 3 * f
    if mesh.corners[h] == vertex:
        return 12 * f + 3 * i
    return 12 * f + 3 * (i + 1 if i < 2 else 0) + 2


@inlined
def _half_in_quads(mesh, h, vertex):
    """Return the half of a half-edge that is at ``vertex``, where corners become quads."""
    return QUAD * h if mesh.corners[h] == vertex else QUAD * following_corner(mesh, h) + 3


@inlined
def _write_half(mesh, e, vertex, child, quads, to_edges, to_half_edges, to_class):
    """Write a half of edge e: as many half-edges as e, of e's class."""
    to_edges[child, 0], to_edges[child, 1] = vertex, mesh.vertex_count + e
    for side in range(2):
        h = mesh.half_edges[e, side]
        if h >= 0:
            here = _half_in_quads(mesh, h, vertex) if quads else _half_in_triangles(mesh, h, vertex)
            to_half_edges[child, side] = here
        else:
            to_half_edges[child, side] = h
    to_class[child] = mesh.edge_class[e]


@kernel
def split_edges_of_triangles(
    begin: int,
    end: int,
    mesh: Connectivity,
    halves: u4_2d,
    corner_edges: u4_2d,
    edges: u4_2d,
    half_edges: i4_2d,
    edge_class: i1_1d,
):
    """Write the edges of the children of triangles begin … end − 1."""
    following = 3 * begin + 2 * _opened_before(mesh, 3 * begin)
    for f in range(max(begin, 0), end):
        for i in range(3):
            before, after = i - 1 if i > 0 else 2, i + 1 if i < 2 else 0
            leaving, entering = mesh.corner_edges[3 * f + i], mesh.corner_edges[3 * f + before]
            vertex = mesh.corners[3 * f + i]
            out_of = halves[leaving, 0 if vertex < mesh.corners[3 * f + after] else 1]
            into = halves[entering, 0 if vertex < mesh.corners[3 * f + before] else 1]
            if mesh.half_edges[leaving, 0] == 3 * f + i:
                _write_half(mesh, leaving, vertex, out_of, False, edges, half_edges, edge_class)
                following += 1
            inner = following
            following += 1
            if mesh.half_edges[entering, 0] == 3 * f + before:
                _write_half(mesh, entering, vertex, into, False, edges, half_edges, edge_class)
                following += 1
            edges[inner, 0] = mesh.vertex_count + min(leaving, entering)
            edges[inner, 1] = mesh.vertex_count + max(leaving, entering)
            half_edges[inner, 0], half_edges[inner, 1] = 12 * f + 3 * i + 1, 12 * f + 9 + before
            edge_class[inner] = INTERIOR
            corner_edges[4 * f + i, 0], corner_edges[4 * f + i, 1] = out_of, inner
            corner_edges[4 * f + i, 2], corner_edges[4 * f + 3, before] = into, inner


@kernel
def split_edges_into_quads(
    begin: int,
    end: int,
    mesh: Connectivity,
    halves: u4_2d,
    corner_edges: u4_2d,
    edges: u4_2d,
    half_edges: i4_2d,
    edge_class: i1_1d,
):
    """Write the edges of the quads of faces begin … end − 1."""
    following = mesh.offsets[begin] + 2 * _opened_before(mesh, mesh.offsets[begin])
    for f in range(max(begin, 0), end):
        first, stop = mesh.offsets[f], mesh.offsets[f + 1]
        inner_before, inner_of_last = -1, -1
        for h in range(first, stop):
            before, vertex = h - 1 if h > first else stop - 1, mesh.corners[h]
            leaving, entering = mesh.corner_edges[h], mesh.corner_edges[before]
            out_of = halves[leaving, _end_of(mesh, leaving, vertex)]
            into = halves[entering, _end_of(mesh, entering, vertex)]
            if mesh.half_edges[leaving, 0] == h:
                _write_half(mesh, leaving, vertex, out_of, True, edges, half_edges, edge_class)
                following += 1
            inner = following if h + 1 < stop else inner_of_last
            if h == first:
                inner_of_last = inner_before = following + 1
                half_edges[inner_of_last, 0] = QUAD * first + 2
                half_edges[inner_of_last, 1] = QUAD * (stop - 1) + 1
            if h + 1 < stop:
                half_edges[inner, 0], half_edges[inner, 1] = QUAD * h + 1, QUAD * (h + 1) + 2
            following += _inner_edges(h, first, stop)
            edges[inner, 0] = mesh.vertex_count + leaving
            edges[inner, 1] = mesh.vertex_count + mesh.edges.shape[0] + f
            edge_class[inner] = INTERIOR
            if mesh.half_edges[entering, 0] == before:
                _write_half(mesh, entering, vertex, into, True, edges, half_edges, edge_class)
                following += 1
            corner_edges[h, 0], corner_edges[h, 1] = out_of, inner
            corner_edges[h, 2], corner_edges[h, 3] = inner_before, into
            inner_before = inner
