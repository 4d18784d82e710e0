"""The part of a mesh that bends: what is marked, cut out, and put back row by row."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    CLASSES_OUT,
    FLAGS,
    FLAGS_OUT,
    INDEX,
    INDEX_OUT,
    INDICES,
    INDICES_OUT,
    INTEGERS_2,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import BOUNDARY, INTERIOR, IRREGULAR, NONE
from pns_common.fused.kernels.turns import normals_beside
from pns_common.fused.kernels.vectors import difference, dot, row


def _bends(normals, half_edges, edge_class, e):
    """Return whether x of an interior edge is not 0 to the last bit, in either way it is measured.

    Faces without a normal are not known to lie in a plane.
    """
    n, m = normals_beside(normals, half_edges, edge_class, e)
    chord = difference(n, m)
    return (edge_class[e] == INTERIOR) & ((dot(n, m) != 1.0) | (dot(chord, chord) != 0.0))


@kernel(SIZE, POINTS, INDICES, CLASSES, SIZE)
def count_bent(normals, half_edges, edge_class, stride):
    """Return how many of every so-manieth edge bend."""
    bent = 0
    for e in range(0, half_edges.shape[0], stride):
        bent += _bends(normals, half_edges, edge_class, natural(e))
    return bent


@kernel(SIZE, POINTS, INDICES, INDICES, CLASSES, SIZE, SIZE, FLAGS_OUT)
def mark_bent_ends(normals, edges, half_edges, edge_class, begin, end, marked):
    """Mark the ends of those of the edges begin … end − 1 that bend.

    Threads may write the same True at once, here and below.
    """
    for e in range(natural(begin), end):
        if _bends(normals, half_edges, edge_class, e):
            marked[edges[e, 0]] = True
            marked[edges[e, 1]] = True
    return 0


@kernel(SIZE, INDICES, FLAGS, SIZE, SIZE, FLAGS_OUT, FLAGS_OUT)
def mark_around(faces, marked, begin, end, touched, corners):
    """Write which of the faces begin … end − 1 have a marked corner, and mark all corners of these.

    Returns how many there are.
    """
    found = 0
    for f in range(natural(begin), end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        touched[f] = marked[a] | marked[b] | marked[c]
        if touched[f]:
            found += 1
            corners[a] = True
            corners[b] = True
            corners[c] = True
    return found


@kernel(SIZE, INDICES, FLAGS, SIZE, SIZE, FLAGS_OUT)
def mark_sides(face_edges, touched, begin, end, sides):
    """Mark the edges of those of the faces begin … end − 1 that are ``touched``."""
    for f in range(natural(begin), end):
        if touched[f]:
            for i in range(3):
                sides[face_edges[f, i]] = True
    return 0


@kernel(SIZE, FLAGS, INDEX_OUT, INDEX_OUT)
def number_rows(flags, numbers, rows):
    """Write for each row how many marked ones come before it, and which those are; returns both.

    Args:
        numbers, rows: (N,) out; ``rows`` is written as far as there are marked ones.
    """
    count = natural(0)
    for i in range(len(flags)):
        numbers[i] = count
        rows[count] = i
        count += natural(flags[i])
    return count


@kernel(SIZE, INDICES, INDEX, INDEX, SIZE, SIZE, INDICES_OUT)
def take_faces(values, numbers, rows, begin, end, taken):
    """Write three values of each of the faces rows[begin:end] under their numbers in the part."""
    for i in range(natural(begin), end):
        f = rows[i]
        for k in range(3):
            taken[i, k] = numbers[values[f, k]]
    return 0


def _half_edge(half_edge, face_numbers, kept_faces):
    """Return a half-edge's number in the part; NONE where its face is not of it."""
    if half_edge < 0 or not kept_faces[half_edge // 3]:
        return NONE
    f = half_edge // 3
    return 3 * face_numbers[f] + (half_edge - 3 * f)


@kernel(
    SIZE,
    *(INDICES, INTEGERS_2, CLASSES, INDEX, INDEX, INDEX, FLAGS, SIZE, SIZE),
    *(INDICES_OUT, INDICES_OUT, CLASSES_OUT),
)
def take_edges(
    edges,
    half_edges,
    edge_class,
    rows,
    vertex_numbers,
    face_numbers,
    kept_faces,
    begin,
    end,
    part_edges,
    part_half_edges,
    part_class,
):
    """Write ends, half-edges and classes of the edges rows[begin:end] as the part has them.

    An edge that loses one of its two faces is a boundary of the part. ``kept_faces`` are its faces.
    """
    for i in range(natural(begin), end):
        e = rows[i]
        kind, first, second = edge_class[e], half_edges[e, 0], half_edges[e, 1]
        part_edges[i, 0] = vertex_numbers[edges[e, 0]]
        part_edges[i, 1] = vertex_numbers[edges[e, 1]]
        one = _half_edge(first, face_numbers, kept_faces)
        other = _half_edge(second, face_numbers, kept_faces) if second >= 0 else second
        if one == NONE or (other == NONE and second >= 0):
            kind = BOUNDARY
            if one == NONE:
                one, other = other, NONE
            if one < 0:
                # Of several faces one that is not named here.
                one, other, kind = 0, NONE, IRREGULAR
        part_half_edges[i, 0], part_half_edges[i, 1], part_class[i] = one, other, kind
    return 0


@kernel(
    SIZE,
    *(FLAGS, INDEX, POINTS, NUMBERS, NUMBERS, NUMBERS, FLAGS, SIZE, SIZE),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT, FLAGS_OUT, FLAGS_OUT),
)
def spread(
    kept,
    numbers,
    part_displacement,
    part_ratio,
    part_gate,
    part_envelope,
    part_degenerate,
    begin,
    end,
    displacement,
    ratio,
    gate,
    envelope,
    degenerate,
    moved,
):
    """Write what the part's rows got into the rows begin … end − 1 of the whole; 0 into others.

    Args:
        kept, numbers: rows that are of the part, and their numbers there.
        moved: out: rows that got something.
    """
    for i in range(natural(begin), end):
        if kept[i]:
            at = numbers[i]
            x, y, z = row(part_displacement, at)
            displacement[i, 0], displacement[i, 1], displacement[i, 2] = x, y, z
            ratio[i], gate[i], envelope[i] = part_ratio[at], part_gate[at], part_envelope[at]
            degenerate[i] = part_degenerate[at]
            moved[i] = (x != 0) | (y != 0) | (z != 0)
        else:
            displacement[i, 0] = displacement[i, 1] = displacement[i, 2] = 0.0
            ratio[i] = gate[i] = envelope[i] = 0.0
            degenerate[i] = moved[i] = False
    return 0
