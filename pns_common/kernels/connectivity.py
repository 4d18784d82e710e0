"""Edges of a face list, fans around vertices, and the edges of a split mesh by arithmetic.

Half-edge h starts at corner h; in triangle meshes corner i of face f is 3 f + i. Edges are numbered
by first appearance over faces.
"""

from __future__ import annotations

import numpy as np

from pns_common.kernels import (
    b1_1d,
    i1_1d,
    i4_1d,
    i4_2d,
    i8_1d,
    i8_2d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)

INTERIOR, BOUNDARY, IRREGULAR, CREASE = 0, 1, 2, 3
# In place of an edge's second half-edge: there is none; there are more than two.
NONE, SEVERAL = -1, -2
# Returned by ``number_edges`` in place of a count.
TOO_LONG = -1
# Rows of a block that a thread may skip as a whole.
SKIPPED_ROWS = 1024


@inlined
def skipped_block(rows, reach, block, begin, end):
    """Return a block's first row and its number of rows; 0 rows if none is in begin … end − 1.

    ``reach`` has the smallest and the largest vertex of each block.
    """
    first = max(SKIPPED_ROWS * block, 0)
    last = min(first + SKIPPED_ROWS, rows.shape[0])
    inside = reach[block, 1] >= begin and reach[block, 0] < end
    return first, last - first if inside else 0


# Columns of a link: the edge's higher vertex, the next link of the chain, its half-edges.
HIGH, NEXT, FIRST, SECOND = 0, 1, 2, 3


@kernel
def number_edges(
    corners: u4_1d,
    offsets: i4_1d,
    most_steps: int,
    head: i4_1d,
    low: u4_1d,
    links: i4_2d,
    corner_edges: u4_1d,
    plain: i1_1d,
):
    """Assign a number to each edge of a face list; return how many there are.

    Each vertex keeps a chain of the edges whose lower end it is. A vertex that is the lower end of
    k edges takes k² / 2 steps; beyond ``most_steps`` in all, return TOO_LONG.

    Args:
        corners: (H,) vertices of the faces, face after face.
        offsets: (F + 1,) where the corners of each face begin.
        head: (V,) first edge of each vertex's chain; −1 on entry.
        low: (H,) out: lower end of each edge.
        links: (H, 4) out: HIGH, NEXT, FIRST, SECOND of each edge; SECOND is NONE or SEVERAL where
            an edge has one half-edge or more than two.
        corner_edges: (H,) out: the edge that leaves each corner.
        plain: (1,) out, for triangles: 1 if no face names a vertex twice and no two faces have the
            same three vertices, as far as is known; else 0.
    """
    count, steps = 0, 0
    plain[0] = 1
    for f in range(offsets.shape[0] - 1):
        first, stop = offsets[f], offsets[f + 1]
        fresh = False
        for h in range(first, stop):
            start, end = corners[h], corners[h + 1 if h + 1 < stop else first]
            a, b = (start, end) if start < end else (end, start)
            if a == b:
                plain[0] = 0
            e = head[a]
            while e >= 0 and links[e, HIGH] != b:
                e = links[e, NEXT]
                steps += 1
            if e < 0:
                e = count
                count += 1
                fresh = True
                low[e] = a
                links[e, HIGH], links[e, NEXT], links[e, FIRST] = b, head[a], h
                links[e, SECOND] = NONE
                head[a] = e
            elif links[e, SECOND] == NONE:
                links[e, SECOND] = h
            else:
                links[e, SECOND] = SEVERAL
            corner_edges[h] = e
        if steps > most_steps:
            return TOO_LONG
        # A face whose vertices are those of an earlier one brings no edge.
        if not fresh and plain[0] == 1 and _may_have_twin(corner_edges, links, f):
            plain[0] = 0
    return count


@kernel
def read_links(low: u4_1d, links: i4_2d, begin: int, end: int, edges: u4_2d, half_edges: i4_2d):
    """Write ends and half-edges of edges begin … end − 1, as ``number_edges`` links them."""
    for e in range(max(begin, 0), end):
        edges[e, 0], edges[e, 1] = low[e], links[e, HIGH]
        half_edges[e, 0], half_edges[e, 1] = links[e, FIRST], links[e, SECOND]


@inlined
def _may_have_twin(corner_edges, links, f):
    """Return whether an earlier triangle may have the edges of triangle f; True if not known."""
    for i in range(3):
        e = corner_edges[3 * f + i]
        if links[e, SECOND] >= 0:
            g = 3 * (links[e, FIRST] // 3)
            other = corner_edges[3 * f + (i + 1 if i < 2 else 0)]
            return (
                corner_edges[g] == other
                or corner_edges[g + 1] == other
                or corner_edges[g + 2] == other
            )
    return True


@kernel
def mark_repeats(corners: u4_1d, offsets: i4_1d, last_face: i4_1d, repeats: b1_1d):
    """Mark the faces that name a vertex twice; return whether there is one.

    Args:
        last_face: (V,) scratch, of −1.
    """
    found = False
    for f in range(offsets.shape[0] - 1):
        repeats[f] = False
        for h in range(offsets[f], offsets[f + 1]):
            if last_face[corners[h]] == f:
                repeats[f] = found = True
            last_face[corners[h]] = f
    return found


@kernel
def classify_edges(
    corners: u4_1d,
    face_of_corner: u4_1d,
    repeats: b1_1d,
    half_edges: i4_2d,
    begin: int,
    end: int,
    edge_class: i1_1d,
):
    """Write the classes of edges begin … end − 1.

    An interior edge has two half-edges that run against each other. An edge of a face that names a
    vertex twice is irregular.

    Args:
        face_of_corner: (H,); (0,) for triangles.
        repeats: (F,) flags of such faces; (0,) if there are none.
    """
    for e in range(max(begin, 0), end):
        first, second = half_edges[e, 0], half_edges[e, 1]
        kind = IRREGULAR
        if not _in_repeating_face(face_of_corner, repeats, first):
            if second == NONE:
                kind = BOUNDARY
            elif second >= 0 and not _in_repeating_face(face_of_corner, repeats, second):
                kind = INTERIOR if corners[first] != corners[second] else IRREGULAR
        edge_class[e] = kind


@inlined
def _in_repeating_face(face_of_corner, repeats, h):
    if len(repeats) == 0:
        return False
    return repeats[face_of(h, face_of_corner)]


@kernel
def count_ends(edges: u4_2d, rows: i8_1d | u4_1d, counts: i4_1d):
    """Count how many of the edges ``rows`` end at each vertex; ``counts`` (V,) is 0 on entry."""
    for e in rows:
        counts[edges[e, 0]] += 1
        counts[edges[e, 1]] += 1


# --- fans -----------------------------------------------------------------------------------------


@inlined
def triangle_of(h):
    """Return h // 3 of h ≥ 0; compiled code of signed numbers would see to those below 0."""
    return np.int64(np.uint64(h) // np.uint64(3))


@inlined
def next_corner(h):
    """Return the next corner of a triangle."""
    return h + 1 - 3 * (np.uint64(h) % np.uint64(3) == np.uint64(2))


@inlined
def previous_corner(h):
    """Return the previous corner of a triangle."""
    return h - 1 + 3 * (np.uint64(h) % np.uint64(3) == np.uint64(0))


@inlined
def opposite(corners, h):
    """Return the vertex of a half-edge's triangle that is not on it."""
    there = np.uint64(h)
    first = there % np.uint64(3) == np.uint64(0)
    return corners[there + np.uint64(2) if first else there - np.uint64(1)]


@inlined
def face_corners(h, offsets, face_of_corner):
    """Return the first corner of a corner's face, and the first after them."""
    if len(face_of_corner) == 0:
        first = 3 * triangle_of(h)
        return first, first + 3
    f = face_of_corner[h]
    return offsets[f], offsets[f + 1]


@inlined
def face_of(h, face_of_corner):
    """Return the face of a corner."""
    return face_of_corner[h] if len(face_of_corner) else triangle_of(h)


@inlined
def following_corner(h, offsets, face_of_corner):
    """Return the next corner of a face of any degree."""
    first, stop = face_corners(h, offsets, face_of_corner)
    return h + 1 if h + 1 < stop else first


@inlined
def preceding_corner(h, offsets, face_of_corner):
    """Return the previous corner of a face of any degree."""
    first, stop = face_corners(h, offsets, face_of_corner)
    return h - 1 if h > first else stop - 1


@inlined
def twin(corner_edges, half_edges, edge_class, h):
    """Return the other half-edge of an interior or crease edge; −1 at other edges."""
    e = corner_edges[h]
    if edge_class[e] == BOUNDARY or edge_class[e] == IRREGULAR:
        return -1
    first = half_edges[e, 0]
    return half_edges[e, 1] if first == h else first


@kernel
def count_corners(corners: u4_1d, reach: i8_2d, begin: int, end: int, corner: i4_1d, count: i4_1d):
    """Write the last corner at each vertex begin … end − 1, and how many there are.

    ``reach`` is that of blocks of 3 × SKIPPED_ROWS corners.
    """
    for v in range(max(begin, 0), end):
        count[v] = 0
    for block in range(reach.shape[0]):
        if reach[block, 1] < begin or reach[block, 0] >= end:
            continue
        first = 3 * SKIPPED_ROWS * block
        for h in range(first, min(first + 3 * SKIPPED_ROWS, corners.shape[0])):
            v = corners[h]
            if begin <= v < end:
                corner[v] = h
                count[v] += 1


@kernel
def count_fans(
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    corner: i4_1d,
    count: i4_1d,
    begin: int,
    end: int,
    fans: i1_1d,
):
    """Write how many fans the corners of vertices begin … end − 1 form: 0, 1, or 2 for more.

    Creases divide no fan. ``corner`` and ``count`` come from ``count_corners``.
    """
    for v in range(max(begin, 0), end):
        fans[v] = 0
        if count[v] == 0:
            continue
        start = corner[v]
        seen, h = 1, start
        while seen <= count[v]:
            h = twin(corner_edges, half_edges, edge_class, h)
            if h < 0:
                break
            h = following_corner(h, offsets, face_of_corner)
            if h == start:
                break
            seen += 1
        if h < 0:
            h = start
            while seen <= count[v]:
                before = preceding_corner(h, offsets, face_of_corner)
                h = twin(corner_edges, half_edges, edge_class, before)
                if h < 0:
                    break
                seen += 1
        fans[v] = 1 if seen == count[v] else 2


# --- the split of triangles ----------------------------------------------------------------------
#
# A parent edge has two children, a parent face three edges inside it. Over the faces (a, ab, ca),
# (b, bc, ab), (c, ca, bc), (ab, bc, ca) of a parent they appear in this order, the children of an
# edge only in the first face that it is on:
#
#     a–ab  ab–ca  ca–a    b–bc  bc–ab  ab–b    c–ca  ca–bc  bc–c
#
# So corner i holds half of the edge that leaves it, the edge that cuts it off, and half of the edge
# that enters it. This holds where no face names a vertex twice and no two have the same three.


@kernel
def split_faces(
    faces: u4_2d,
    face_edges: u4_2d,
    vertex_count: int,
    begin: int,
    end: int,
    to_faces: i8_2d | u4_2d,
):
    """Write the children 4 f … 4 f + 3 of triangles begin … end − 1."""
    for f in range(max(begin, 0), end):
        for i in range(3):
            middle = vertex_count + face_edges[f, i]
            before = i - 1 if i > 0 else 2
            to_faces[4 * f + i, 0] = faces[f, i]
            to_faces[4 * f + i, 1] = middle
            to_faces[4 * f + i, 2] = vertex_count + face_edges[f, before]
            to_faces[4 * f + 3, i] = middle


@inlined
def opened_before(half_edges, corner):
    """Count the edges that first appear before a corner; first half-edges ascend."""
    least, most = 0, half_edges.shape[0]
    while least < most:
        middle = (least + most) // 2
        if half_edges[middle, 0] < corner:
            least = middle + 1
        else:
            most = middle
    return least


@kernel
def number_halves(
    faces: u4_2d,
    face_edges: u4_2d,
    edges: u4_2d,
    half_edges: i4_2d,
    begin: int,
    end: int,
    halves: u4_2d,
):
    """Assign numbers to both children of the edges that first appear in faces begin … end − 1.

    ``halves`` (E, 2), out: the child at the lower endpoint, and at the higher.
    """
    following = 3 * begin + 2 * opened_before(half_edges, 3 * begin)
    for f in range(max(begin, 0), end):
        for i in range(3):
            before = i - 1 if i > 0 else 2
            leaving, entering, vertex = face_edges[f, i], face_edges[f, before], faces[f, i]
            if half_edges[leaving, 0] == 3 * f + i:
                halves[leaving, 0 if vertex == edges[leaving, 0] else 1] = following
                following += 1
            following += 1
            if half_edges[entering, 0] == 3 * f + before:
                halves[entering, 0 if vertex == edges[entering, 0] else 1] = following
                following += 1


@inlined
def _half_at(h, faces, vertex):
    """Return the half of a parent's half-edge that is at ``vertex``."""
    f = triangle_of(h)
    i = h - 3 * f
    if faces[f, i] == vertex:
        return 12 * f + 3 * i
    return 12 * f + 3 * (i + 1 if i < 2 else 0) + 2


@inlined
def _write_half(e, vertex, child, faces, vertex_count, half_edges, edge_class, to):
    """Write a child of parent edge e: as many half-edges as e, of e's class."""
    to_edges, to_half_edges, to_class = to
    to_edges[child, 0], to_edges[child, 1] = vertex, vertex_count + e
    first, second = half_edges[e, 0], half_edges[e, 1]
    to_half_edges[child, 0] = _half_at(first, faces, vertex)
    to_half_edges[child, 1] = second if second < 0 else _half_at(second, faces, vertex)
    to_class[child] = edge_class[e]


@kernel
def split_edges(
    faces: u4_2d,
    face_edges: u4_2d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    halves: u4_2d,
    vertex_count: int,
    begin: int,
    end: int,
    to_face_edges: u4_2d,
    to_edges: u4_2d,
    to_half_edges: i4_2d,
    to_class: i1_1d,
):
    """Write the edges of the children of triangles begin … end − 1."""
    to = to_edges, to_half_edges, to_class
    following = 3 * begin + 2 * opened_before(half_edges, 3 * begin)
    for f in range(max(begin, 0), end):
        for i in range(3):
            before, after = i - 1 if i > 0 else 2, i + 1 if i < 2 else 0
            leaving, entering, vertex = face_edges[f, i], face_edges[f, before], faces[f, i]
            out_of = halves[leaving, 0 if vertex < faces[f, after] else 1]
            into = halves[entering, 0 if vertex < faces[f, before] else 1]
            if half_edges[leaving, 0] == 3 * f + i:
                _write_half(
                    leaving, vertex, out_of, faces, vertex_count, half_edges, edge_class, to
                )
                following += 1
            inner = following
            following += 1
            if half_edges[entering, 0] == 3 * f + before:
                _write_half(entering, vertex, into, faces, vertex_count, half_edges, edge_class, to)
                following += 1
            source, target = vertex_count + leaving, vertex_count + entering
            to_edges[inner, 0], to_edges[inner, 1] = min(source, target), max(source, target)
            to_half_edges[inner, 0] = 12 * f + 3 * i + 1
            to_half_edges[inner, 1] = 12 * f + 9 + before
            to_class[inner] = INTERIOR
            to_face_edges[4 * f + i, 0] = out_of
            to_face_edges[4 * f + i, 1] = inner
            to_face_edges[4 * f + i, 2] = into
            to_face_edges[4 * f + 3, before] = inner


@kernel
def pair_up(first: i8_1d, second: i8_1d, free: b1_1d, chosen: b1_1d):
    """Choose pairs in their order, each of two things that are free; they are free no longer."""
    for n in range(len(first)):
        if free[first[n]] and free[second[n]]:
            free[first[n]] = free[second[n]] = False
            chosen[n] = True
