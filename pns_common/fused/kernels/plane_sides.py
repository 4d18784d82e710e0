"""What may lie beside a plane side, of which geometry/crease_lines/plane_sides.py decides."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS_OUT,
    INDEX,
    INDICES,
    POINTS,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.turns import turn_cosine


def goes_on(normals, face_edges, half_edges, edge_class, cosine, f, e):
    """Return whether a face goes on in its plane across both sides beside its edge e."""
    for k in range(3):
        side = face_edges[f, k]
        if side != e and edge_class[side] != INTERIOR:
            return False
        if side != e and not turn_cosine(normals, half_edges, edge_class, side) > cosine:
            return False
    return True


@kernel(SIZE, POINTS, INDICES, INDICES, CLASSES, REAL, INDEX, SIZE, SIZE, FLAGS_OUT)
def mark_beside_level_faces(
    normals, face_edges, half_edges, edge_class, cosine, rows, begin, end, marks
):
    """Mark edges begin … end − 1 of some with a face that goes on in its plane.

    If the third corner of one lies inside a plane side it does.
    """
    for i in range(natural(begin), end):
        e = rows[i]
        first, second = half_edges[e, 0] // 3, half_edges[e, 1] // 3
        around = normals, face_edges, half_edges, edge_class, cosine
        marks[i] = goes_on(*around, first, e) or goes_on(*around, second, e)
    return 0
