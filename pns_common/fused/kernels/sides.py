"""What lies between two sides, with the answers of geometry/crease_lines/sides.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS,
    FLAGS_OUT,
    INDEX,
    INDICES,
    POINTS,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.turns import clearly_half, turn_cosine


def is_flat(normals, face_edges, half_edges, edge_class, f, e):
    """Return whether a face is flat beside its edge e: another turns less than half as much."""
    flattest = -1.0
    for k in range(3):
        other = face_edges[f, k]
        if other != e:
            flattest = max(flattest, turn_cosine(normals, half_edges, edge_class, other))
    return flattest > clearly_half(turn_cosine(normals, half_edges, edge_class, e))


def is_side(normals, face_edges, half_edges, edge_class, is_sharp, f):
    """Return whether a face is a side by itself."""
    for k in range(3):
        e = face_edges[f, k]
        if not is_sharp[e]:
            return False
        first, second = half_edges[e, 0] // 3, half_edges[e, 1] // 3
        across = second if first == f else first
        if not is_flat(normals, face_edges, half_edges, edge_class, across, e):
            return False
    return True


@kernel(SIZE, POINTS, INDICES, INDICES, CLASSES, FLAGS, INDEX, SIZE, SIZE, FLAGS_OUT)
def mark_between_sides(
    normals, face_edges, half_edges, edge_class, is_sharp, sharp, begin, end, between
):
    """Mark those of the sharp edges begin … end − 1 at which two sides of a part meet."""
    for i in range(natural(begin), end):
        e = sharp[i]
        first, second = half_edges[e, 0] // 3, half_edges[e, 1] // 3
        first_flat = is_flat(normals, face_edges, half_edges, edge_class, first, e)
        second_flat = is_flat(normals, face_edges, half_edges, edge_class, second, e)
        between[i] = first_flat and second_flat
        if first_flat != second_flat:
            other = second if first_flat else first
            between[i] = is_side(normals, face_edges, half_edges, edge_class, is_sharp, other)
    return 0
