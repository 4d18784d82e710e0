"""Fans of corners around vertices, with the counts of ``Topology.multi_fan_vertices``."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS_OUT,
    INDEX,
    INDEX_OUT,
    INDICES,
    INTEGERS_2,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import CREASE, INTERIOR
from pns_common.fused.kernels.owned import owned_rows

# The fewest faces that close around a vertex.
SMALLEST_RING = 3


def _across(face_edges, half_edges, edge_class, half_edge):
    """Return an interior or crease edge's other half-edge, else −1: a crease parts no fan."""
    f = half_edge // 3
    e = face_edges[f, half_edge - 3 * f]
    if edge_class[e] != INTERIOR and edge_class[e] != CREASE:
        return -1
    first = half_edges[e, 0]
    return half_edges[e, 1] if first == half_edge else first


@kernel(SIZE, INDICES, INDICES, SIZE, SIZE, INDEX_OUT, INDEX_OUT)
def count_corners(faces, reach, begin, end, corner, count):
    """Write a corner of each vertex begin … end − 1, and how many it has.

    Args:
        reach: the smallest and the largest vertex of each block of faces (owned.py).
        corner: (V,) out: the last one; of a vertex of no face nothing is written.
        count: (V,) out.
    """
    for v in range(natural(begin), end):
        count[v] = 0
    for block in range(reach.shape[0]):
        first, asked = owned_rows(faces, reach, block, begin, end)
        for k in range(asked):
            f = first + k
            for i in range(3):
                v = faces[f, i]
                if begin <= v < end:
                    corner[v] = 3 * f + i
                    count[v] += 1
    return 0


@kernel(SIZE, INDICES, INTEGERS_2, CLASSES, INDEX, INDEX, INDEX, SIZE, SIZE, SIZE, FLAGS_OUT)
def mark_multi_fan(
    face_edges, half_edges, edge_class, corner, count, sharp, plain, begin, end, multi_fan
):
    """Mark the vertices begin … end − 1 that have corners outside the fan of their ``corner``.

    Args:
        sharp: how many edges at each vertex are not interior; (0,) where there are none at all.
        plain: 1 where no face repeats a vertex and no two faces have the same three. Then where all
            edges are interior every fan is closed and has three corners or more: what is fewer
            cannot be another.
    """
    for v in range(begin, end):
        multi_fan[v] = False
        if count[v] == 0:
            continue
        start = corner[v]
        closed = plain and (len(sharp) == 0 or sharp[v] == 0)
        enough = count[v] - SMALLEST_RING if closed else count[v]
        seen, h = 1, start
        if seen > enough:
            continue
        while True:
            # Across the half-edge that leaves the corner; the next corner is where the other ends.
            twin = _across(face_edges, half_edges, edge_class, h)
            if twin < 0:
                break
            h = twin + 1 if twin % 3 < 2 else twin - 2
            if h == start:
                break
            seen += 1
            if seen > enough:
                break
        if seen > enough:
            continue
        if twin < 0:
            h = start
            while True:
                twin = _across(face_edges, half_edges, edge_class, h - 1 if h % 3 > 0 else h + 2)
                if twin < 0:
                    break
                h = twin
                seen += 1
        multi_fan[v] = seen != count[v]
    return 0
