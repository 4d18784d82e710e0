"""Which edges turn by more than an angle, with the answers of geometry/crease_lines.py."""

from __future__ import annotations

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
from pns_common.fused.kernels.rings import dot, row


@kernel(SIZE, POINTS, INDICES, CLASSES, REAL, SIZE, SIZE, FLAGS_OUT)
def mark_edges_beyond(normals, half_edges, edge_class, cosine, begin, end, beyond):
    """Mark interior edges begin … end − 1 whose faces' normals have a smaller cosine.

    Faces without a normal are beside none of them. Returns how many there are.
    """
    found = 0
    for e in range(natural(begin), end):
        interior = edge_class[e] == INTERIOR
        first = half_edges[e, 0]
        second = half_edges[e, 1] if interior else first
        n, m = row(normals, first // 3), row(normals, second // 3)
        defined = (dot(n, n) > 0) & (dot(m, m) > 0)
        beyond[e] = interior & defined & (dot(n, m) < cosine)
        found += beyond[e]
    return found
