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
def _inner_edges(h, first, stop, quads):
    """Return how many inner edges appear first in the child of corner h."""
    if not quads:
        return 1
    return 2 if h == first else 1 if h + 1 < stop else 0


@inlined
def _end_of(mesh, e, vertex):
    """Return which end of an edge a vertex is."""
    return 0 if vertex == mesh.edges[e, 0] else 1


@kernel
def number_halves(begin: int, end: int, mesh: Connectivity, quads: bool, halves: u4_2d):
    """Assign numbers to both halves of the edges that first appear in faces begin … end − 1.

    ``quads``: whether corners become quads. ``halves`` (E, 2), out: the half at the lower endpoint,
    and at the higher.
    """
    following = mesh.offsets[begin] + 2 * _opened_before(mesh, mesh.offsets[begin])
    for f in range(max(begin, 0), end):
        first, stop = mesh.offsets[f], mesh.offsets[f + 1]
        for h in range(first, stop):
            before, vertex = h - 1 if h > first else stop - 1, mesh.corners[h]
            leaving, entering = mesh.corner_edges[h], mesh.corner_edges[before]
            if mesh.half_edges[leaving, 0] == h:
                halves[leaving, _end_of(mesh, leaving, vertex)] = following
                following += 1
            following += _inner_edges(h, first, stop, quads)
            if mesh.half_edges[entering, 0] == before:
                halves[entering, _end_of(mesh, entering, vertex)] = following
                following += 1


@inlined
def _half_at(mesh, h, vertex, quads):
    """Return the half of a half-edge that is at ``vertex``."""
    starts = mesh.corners[h] == vertex
    corner = h if starts else following_corner(mesh, h)
    if quads:
        return QUAD * corner + (0 if starts else 3)
    return 3 * (corner + triangle_of(corner)) + (0 if starts else 2)


@inlined
def _write_half(mesh, e, vertex, child, quads, to_edges, to_half_edges, to_class):
    """Write a half of edge e: as many half-edges as e, of e's class."""
    to_edges[child, 0], to_edges[child, 1] = vertex, mesh.vertex_count + e
    for side in range(2):
        h = mesh.half_edges[e, side]
        to_half_edges[child, side] = _half_at(mesh, h, vertex, quads) if h >= 0 else h
    to_class[child] = mesh.edge_class[e]


@kernel
def split_edges(
    begin: int,
    end: int,
    mesh: Connectivity,
    quads: bool,
    halves: u4_2d,
    corner_edges: u4_2d,
    edges: u4_2d,
    half_edges: i4_2d,
    edge_class: i1_1d,
):
    """Write the edges of the children of faces begin … end − 1; ``quads``: corners become quads."""
    count, at_faces = mesh.vertex_count, mesh.vertex_count + mesh.edges.shape[0]
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
                _write_half(mesh, leaving, vertex, out_of, quads, edges, half_edges, edge_class)
                following += 1
            inner = following if not quads or h + 1 < stop else inner_of_last
            if not quads:
                edges[inner, 0], edges[inner, 1] = (
                    count + min(leaving, entering),
                    count + max(leaving, entering),
                )
                half_edges[inner, 0] = 3 * (h + f) + 1
                half_edges[inner, 1] = 12 * f + 9 + before - first
                corner_edges[h + f, 0], corner_edges[h + f, 1] = out_of, inner
                corner_edges[h + f, 2], corner_edges[4 * f + 3, before - first] = into, inner
            else:
                if h == first:
                    inner_of_last = inner_before = following + 1
                    half_edges[inner_of_last, 0] = QUAD * first + 2
                    half_edges[inner_of_last, 1] = QUAD * (stop - 1) + 1
                if h + 1 < stop:
                    half_edges[inner, 0], half_edges[inner, 1] = QUAD * h + 1, QUAD * (h + 1) + 2
                edges[inner, 0], edges[inner, 1] = count + leaving, at_faces + f
                corner_edges[h, 0], corner_edges[h, 1] = out_of, inner
                corner_edges[h, 2], corner_edges[h, 3] = inner_before, into
                inner_before = inner
            edge_class[inner] = INTERIOR
            following += _inner_edges(h, first, stop, quads)
            if mesh.half_edges[entering, 0] == before:
                _write_half(mesh, entering, vertex, into, quads, edges, half_edges, edge_class)
                following += 1
