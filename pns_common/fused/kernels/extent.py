"""Sums over the referenced vertices, in the order in which numpy sums rows."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    FLAGS,
    FLAGS_OUT,
    INDICES,
    LONG_INDICES,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    REAL,
    SIZE,
    kernel,
)


def _mark_corners(faces, begin, end, used):
    for f in range(begin, end):
        for i in range(3):
            used[faces[f, i]] = True


@kernel(SIZE, LONG_INDICES, SIZE, SIZE, FLAGS_OUT)
def mark_referenced_long(faces, begin, end, used):
    """Mark the vertices of faces begin … end − 1; threads may write the same True at once."""
    _mark_corners(faces, begin, end, used)
    return 0


@kernel(SIZE, INDICES, SIZE, SIZE, FLAGS_OUT)
def mark_referenced(faces, begin, end, used):
    """Mark the same of faces in int32."""
    _mark_corners(faces, begin, end, used)
    return 0


@kernel(SIZE, POINTS, FLAGS, NUMBERS_OUT)
def sum_referenced(points, used, total):
    """Write the sum of the marked vertices; returns how many there are."""
    count, x, y, z = 0, 0.0, 0.0, 0.0
    for v in range(points.shape[0]):
        if used[v]:
            count += 1
            x += points[v, 0]
            y += points[v, 1]
            z += points[v, 2]
    total[0], total[1], total[2] = x, y, z
    return count


@kernel(REAL, POINTS, FLAGS, NUMBERS)
def farthest(points, used, centre):
    """Return the largest distance of a used vertex from ``centre``."""
    largest = 0.0
    for v in range(points.shape[0]):
        if used[v]:
            x, y, z = points[v, 0] - centre[0], points[v, 1] - centre[1], points[v, 2] - centre[2]
            largest = max(largest, x * x + y * y + z * z)
    return math.sqrt(largest)
