"""Edges of a split mesh by arithmetic from its parent's.

A parent edge has two children, a parent face three edges inside it. Over the faces (a, ab, ca),
(b, bc, ab), (c, ca, bc), (ab, bc, ca) of a parent they appear in this order, the children of an
edge only in the first face that it is on:

    a–ab  ab–ca  ca–a    b–bc  bc–ab  ab–b    c–ca  ca–bc  bc–c

So corner i holds, in its three places, half of the edge that leaves it, the edge that cuts it off,
and half of the edge that enters it. This holds where the parent is *plain* (see edges.py); its
children are plain too.
"""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    CLASSES_OUT,
    INDICES,
    INDICES_OUT,
    INTEGERS_2,
    LONG_INDICES_OUT,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR


def _opened_before(half_edges, face):
    """Count the edges that first appear in an earlier face (they ascend by first half-edge)."""
    least, most = 0, half_edges.shape[0]
    while least < most:
        middle = (least + most) // 2
        if half_edges[middle, 0] < 3 * face:
            least = middle + 1
        else:
            most = middle
    return least


def corner_after(i):
    """Return the corner after corner i of a face."""
    return i + 1 if i < 2 else 0


def corner_before(i):
    """Return the corner before it."""
    return i - 1 if i > 0 else 2


@kernel(SIZE, INDICES, INDICES, INDICES, INDICES, SIZE, SIZE, INDICES_OUT)
def number_halves(faces, face_edges, edges, half_edges, begin, end, halves):
    """Give numbers to both children of the edges that first appear in faces begin … end − 1.

    Args:
        halves: (E, 2) out: the child at the lower endpoint, and at the higher.
    """
    following = natural(3 * begin + 2 * _opened_before(half_edges, begin))
    for f in range(natural(begin), end):
        for i in range(3):
            leaving, entering = face_edges[f, i], face_edges[f, corner_before(i)]
            vertex = faces[f, i]
            if half_edges[leaving, 0] == 3 * f + i:
                halves[leaving, 0 if vertex == edges[leaving, 0] else 1] = following
                following += 1
            following += 1
            if half_edges[entering, 0] == 3 * f + corner_before(i):
                halves[entering, 0 if vertex == edges[entering, 0] else 1] = following
                following += 1
    return following


def _at_vertex(half_edge, faces, vertex):
    """Return the child at ``vertex`` of a parent's half-edge."""
    f = half_edge // 3
    i = half_edge - 3 * f
    if faces[f, i] == vertex:
        return 12 * f + 3 * i
    return 12 * f + 3 * corner_after(i) + 2


def _fill_half(
    e, vertex, child, faces, vertex_count, half_edges, kind, to_edges, to_halves, to_kind
):
    """Write a child of a parent edge e: as many half-edges as e, of the same class."""
    to_edges[child, 0], to_edges[child, 1] = vertex, vertex_count + e
    first, second = half_edges[e, 0], half_edges[e, 1]
    to_halves[child, 0] = _at_vertex(first, faces, vertex)
    to_halves[child, 1] = second if second < 0 else _at_vertex(second, faces, vertex)
    to_kind[child] = kind


@kernel(
    SIZE,
    *(INDICES, INDICES, INTEGERS_2, CLASSES, INDICES, SIZE, SIZE, SIZE),
    *(INDICES_OUT, INDICES_OUT, INDICES_OUT, CLASSES_OUT),
)
def split_edges(
    faces,
    face_edges,
    half_edges,
    edge_class,
    halves,
    vertex_count,
    begin,
    end,
    to_face_edges,
    to_edges,
    to_half_edges,
    to_class,
):
    """Write the edges of children of faces begin … end − 1, in the layout of ``edges.classify``."""
    following = natural(3 * begin + 2 * _opened_before(half_edges, begin))
    for f in range(natural(begin), end):
        for i in range(3):
            before = corner_before(i)
            leaving, entering = face_edges[f, i], face_edges[f, before]
            vertex = faces[f, i]
            # The edge's number is at its other end, if this face comes later.
            out_of = halves[leaving, 0 if vertex < faces[f, corner_after(i)] else 1]
            into = halves[entering, 0 if vertex < faces[f, before] else 1]
            if half_edges[leaving, 0] == 3 * f + i:
                _fill_half(
                    leaving,
                    vertex,
                    out_of,
                    faces,
                    vertex_count,
                    half_edges,
                    edge_class[leaving],
                    to_edges,
                    to_half_edges,
                    to_class,
                )
                following += 1
            inner = following
            following += 1
            if half_edges[entering, 0] == 3 * f + before:
                _fill_half(
                    entering,
                    vertex,
                    into,
                    faces,
                    vertex_count,
                    half_edges,
                    edge_class[entering],
                    to_edges,
                    to_half_edges,
                    to_class,
                )
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
    return following


def _split_faces(faces, face_edges, vertex_count, begin, end, to_faces):
    for f in range(natural(begin), end):
        for i in range(3):
            middle = vertex_count + face_edges[f, i]
            to_faces[4 * f + i, 0] = faces[f, i]
            to_faces[4 * f + i, 1] = middle
            to_faces[4 * f + i, 2] = vertex_count + face_edges[f, corner_before(i)]
            to_faces[4 * f + 3, i] = middle


@kernel(SIZE, INDICES, INDICES, SIZE, SIZE, SIZE, INDICES_OUT)
def split_faces(faces, face_edges, vertex_count, begin, end, to_faces):
    """Write the children 4 f … 4 f + 3 of faces begin … end − 1."""
    _split_faces(faces, face_edges, vertex_count, begin, end, to_faces)
    return 0


@kernel(SIZE, INDICES, INDICES, SIZE, SIZE, SIZE, LONG_INDICES_OUT)
def split_faces_long(faces, face_edges, vertex_count, begin, end, to_faces):
    """Write the same in int64."""
    _split_faces(faces, face_edges, vertex_count, begin, end, to_faces)
    return 0
