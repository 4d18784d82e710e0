"""Edges of a face list, their classes, and steps from corner to corner.

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
    inlined,
    kernel,
    u4_1d,
)

INTERIOR, BOUNDARY, IRREGULAR, CREASE = 0, 1, 2, 3
# In place of an edge's second half-edge: there is none; there are more than two.
NONE, SEVERAL = -1, -2
# Returned by ``number_edges`` in place of a count.
TOO_LONG = -1
# Rows of a block that a thread may skip as a whole.
SKIPPED_ROWS = 1024


@inlined
def rows_of_block(reach, block, each, count, begin, end):
    """Return where a block of ``each`` rows begins and ends; empty if no vertex is in begin … end.

    ``reach`` has the smallest and the largest vertex of each block of ``count`` rows.
    """
    first = max(each * block, 0)
    stop = min(first + each, count)
    return first, stop if reach[block, 1] >= begin and reach[block, 0] < end else first


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
    begin: int,
    end: int,
    corners: u4_1d,
    face_of_corner: u4_1d,
    repeats: b1_1d,
    half_edges: i4_2d,
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
    return repeats[face_of_corner[h] if len(face_of_corner) else triangle_of(h)]


# --- steps ----------------------------------------------------------------------------------------


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
def face_of(mesh, h):
    """Return the face of a corner."""
    return mesh.face_of_corner[h] if len(mesh.face_of_corner) else triangle_of(h)


@inlined
def following_corner(mesh, h):
    """Return the next corner of a face of any degree."""
    if len(mesh.face_of_corner) == 0:
        return next_corner(h)
    f = mesh.face_of_corner[h]
    return h + 1 if h + 1 < mesh.offsets[f + 1] else mesh.offsets[f]


@inlined
def preceding_corner(mesh, h):
    """Return the previous corner of a face of any degree."""
    if len(mesh.face_of_corner) == 0:
        return previous_corner(h)
    f = mesh.face_of_corner[h]
    return h - 1 if h > mesh.offsets[f] else mesh.offsets[f + 1] - 1


@inlined
def opposed(mesh, h):
    """Return the other half-edge of an interior edge; −1 at other edges."""
    e = mesh.corner_edges[h]
    if mesh.edge_class[e] != INTERIOR:
        return -1
    first = mesh.half_edges[e, 0]
    return mesh.half_edges[e, 1] if first == h else first


@kernel
def pair_up(first: i8_1d, second: i8_1d, free: b1_1d, chosen: b1_1d):
    """Choose pairs in their order, each of two things that are free; they are free no longer."""
    for n in range(len(first)):
        if free[first[n]] and free[second[n]]:
            free[first[n]] = free[second[n]] = False
            chosen[n] = True


@kernel
def count_sides(corner_edges: u4_1d, flags: b1_1d, rows: i8_1d, to: i1_1d):
    """Count the flagged sides of some triangles."""
    for i in range(len(rows)):
        h = 3 * rows[i]
        to[i] = flags[corner_edges[h]]
        to[i] += flags[corner_edges[h + 1]]
        to[i] += flags[corner_edges[h + 2]]
