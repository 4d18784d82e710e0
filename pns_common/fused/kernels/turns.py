"""How far edges turn, with the answers of geometry/crease_lines/turns.py."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS_OUT,
    INDICES,
    POINTS,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.vectors import between, dot, row
from pns_common.geometry.crease_lines.turns import CLEARLY


def normals_beside(normals, half_edges, edge_class, e):
    """Return the normals of an edge's two faces; of its first one twice where it is not interior.

    It does not branch, so that loops over edges run on vectors.
    """
    first = half_edges[e, 0]
    second = half_edges[e, 1] if edge_class[e] == INTERIOR else first
    return row(normals, first // 3), row(normals, second // 3)


def turn_cosine(normals, half_edges, edge_class, e):
    """Return the cosine of the turn at an edge: 1 where it is not interior, or a normal is none."""
    if edge_class[e] != INTERIOR:
        return 1.0
    n, m = row(normals, half_edges[e, 0] // 3), row(normals, half_edges[e, 1] // 3)
    return dot(n, m) if dot(n, n) > 0 and dot(m, m) > 0 else 1.0


def clearly_half(cosine):
    """Return cos(t / 2) of cos t, and a little more."""
    return math.sqrt((1 + max(cosine, -1.0)) / 2) + CLEARLY


def rises(points, normals, faces, edges, half_edges, e):
    """Return whether an edge's second face rises above its first."""
    a, b, f, g = edges[e, 0], edges[e, 1], half_edges[e, 0] // 3, half_edges[e, 1] // 3
    apart = faces[g, 2]
    for k in range(2):
        corner = faces[g, 1 - k]
        if corner != a and corner != b:
            apart = corner
    return dot(row(normals, f), between(points, a, apart)) > 0


@kernel(SIZE, POINTS, INDICES, CLASSES, REAL, SIZE, SIZE, FLAGS_OUT)
def mark_edges_beyond(normals, half_edges, edge_class, cosine, begin, end, beyond):
    """Mark interior edges begin … end − 1 whose faces' normals have a smaller cosine.

    Faces without a normal are beside none of them. Returns how many there are.
    """
    found = 0
    for e in range(natural(begin), end):
        n, m = normals_beside(normals, half_edges, edge_class, e)
        defined = (dot(n, n) > 0) & (dot(m, m) > 0)
        beyond[e] = (edge_class[e] == INTERIOR) & defined & (dot(n, m) < cosine)
        found += beyond[e]
    return found
