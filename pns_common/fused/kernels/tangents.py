"""Tangents at a right angle to normals, with the bits of ``pns_common.geometry.tangents``."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import POINTS, POINTS_OUT, SIZE, called_seldom, kernel
from pns_common.geometry.corner_normals import NO_DIRECTION


@called_seldom
def _flattened_axis(x, y, z):
    """Return what is left in a normal's plane of the axis that the normal is furthest from."""
    i, j, k = 1.0, 0.0, 0.0
    if abs(y) < abs(x):
        i, j = 0.0, 1.0
    if abs(z) < min(abs(x), abs(y)):
        i, j, k = 0.0, 0.0, 1.0
    inner = i * x + j * y + k * z
    return i - inner * x, j - inner * y, k - inner * z


@kernel(SIZE, POINTS, POINTS, SIZE, SIZE, POINTS_OUT)
def perpendicular_tangents(tangents, normals, begin, end, made):
    """Write the unit projections of tangents begin … end − 1 onto the planes of unit normals."""
    for r in range(begin, end):
        i, j, k = tangents[r, 0], tangents[r, 1], tangents[r, 2]
        x, y, z = normals[r, 0], normals[r, 1], normals[r, 2]
        inner = i * x + j * y + k * z
        u, v, w = i - inner * x, j - inner * y, k - inner * z
        length = math.sqrt(u * u + v * v + w * w)
        if length <= NO_DIRECTION * max(math.sqrt(i * i + j * j + k * k), NO_DIRECTION):
            u, v, w = _flattened_axis(x, y, z)
            length = math.sqrt(u * u + v * v + w * w)
        length = length if length > 0 else math.inf
        made[r, 0], made[r, 1], made[r, 2] = u / length, v / length, w / length
    return 0
