"""Sums over the referenced vertices, in the order in which numpy sums rows."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    FLAGS,
    FLAGS_OUT,
    LONG_INDICES,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    REAL,
    SIZE,
    kernel,
)


@kernel(SIZE, POINTS, LONG_INDICES, FLAGS_OUT, NUMBERS_OUT)
def sum_referenced(points, faces, used, total):
    """Mark the vertices of faces and sum them; returns how many there are."""
    for f in range(faces.shape[0]):
        for i in range(3):
            used[faces[f, i]] = True
    count = 0
    for v in range(points.shape[0]):
        if used[v]:
            count += 1
            for k in range(3):
                total[k] += points[v, k]
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
