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
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.normals import COSINE_MARGIN, area, clearly_less, unit_normal


@called_seldom
def _is_beyond(points, faces, f, g, cosine):
    """Return whether the normals of faces f and g have a smaller cosine; each must have one."""
    n = unit_normal(points, faces[f, 0], faces[f, 1], faces[f, 2])
    m = unit_normal(points, faces[g, 0], faces[g, 1], faces[g, 2])
    if n[0] * n[0] + n[1] * n[1] + n[2] * n[2] > 0 and m[0] * m[0] + m[1] * m[1] + m[2] * m[2] > 0:
        return n[0] * m[0] + n[1] * m[1] + n[2] * m[2] < cosine
    return False


def _row(points, i):
    return points[i, 0], points[i, 1], points[i, 2]


@kernel(SIZE, POINTS, INDICES, INTEGERS_2, CLASSES, REAL, SIZE, SIZE, FLAGS_OUT)
def mark_edges_beyond(points, faces, half_edges, edge_class, cosine, begin, end, beyond):
    """Mark interior edges begin … end − 1 whose faces' normals have a smaller cosine.

    Returns how many there are.
    """
    above, found = max(cosine, 0.0) + COSINE_MARGIN, 0
    for e in range(begin, end):
        beyond[e] = False
        if edge_class[e] != INTERIOR:
            continue
        f, g = half_edges[e, 0] // 3, half_edges[e, 1] // 3
        n = area(_row(points, faces[f, 0]), _row(points, faces[f, 1]), _row(points, faces[f, 2]))
        m = area(_row(points, faces[g, 0]), _row(points, faces[g, 1]), _row(points, faces[g, 2]))
        if clearly_less(n, m, above * above):
            continue
        if _is_beyond(points, faces, f, g, cosine):
            beyond[e] = True
            found += 1
    return found
