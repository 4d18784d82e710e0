"""Which edges turn by more than an angle, with the answers of geometry/crease_lines.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS_OUT,
    INDICES,
    INTEGERS_2,
    POINTS,
    REAL,
    SIZE,
    called_seldom,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.normals import (
    COSINE_MARGIN,
    area,
    clearly_less,
    unit_normal,
)
from pns_common.fused.kernels.rings import row
from pns_common.fused.kernels.together import TOGETHER


@called_seldom
def _is_beyond(points, faces, f, g, cosine):
    """Return whether the normals of faces f and g have a smaller cosine; each must have one."""
    n = unit_normal(points, faces[f, 0], faces[f, 1], faces[f, 2])
    m = unit_normal(points, faces[g, 0], faces[g, 1], faces[g, 2])
    if n[0] * n[0] + n[1] * n[1] + n[2] * n[2] > 0 and m[0] * m[0] + m[1] * m[1] + m[2] * m[2] > 0:
        return n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < cosine
    return False


def _area(points, faces, f):
    return area(row(points, faces[f, 0]), row(points, faces[f, 1]), row(points, faces[f, 2]))


def _is_clear(points, faces, half_edges, edge_class, bound, e):
    """Return whether an edge clearly turns less, or is not interior."""
    interior = edge_class[e] == INTERIOR
    first = half_edges[e, 0]
    second = half_edges[e, 1] if interior else first
    n, m = _area(points, faces, first // 3), _area(points, faces, second // 3)
    return clearly_less(n, m, bound) | (not interior)


@kernel(SIZE, POINTS, INDICES, INTEGERS_2, CLASSES, REAL, SIZE, SIZE, FLAGS_OUT)
def mark_edges_beyond(points, faces, half_edges, edge_class, cosine, begin, end, beyond):
    """Mark interior edges begin … end − 1 whose faces' normals have a smaller cosine.

    ``beyond`` is False on entry. Returns how many there are.
    """
    above, found = max(cosine, 0.0) + COSINE_MARGIN, 0
    bound, around = above * above, (points, faces, half_edges, edge_class)
    for first in range(natural(begin), end, TOGETHER):
        last, doubtful = min(first + TOGETHER, end), 0
        for e in range(first, last):
            doubtful += not _is_clear(*around, bound, e)
        if doubtful == 0:
            continue
        for e in range(first, last):
            if edge_class[e] != INTERIOR:
                continue
            if _is_beyond(points, faces, half_edges[e, 0] // 3, half_edges[e, 1] // 3, cosine):
                beyond[e] = True
                found += 1
    return found
