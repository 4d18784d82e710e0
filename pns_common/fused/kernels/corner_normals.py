"""Normals of groups of corners, with the bits of ``pns_common.geometry.corner_normals``."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    INDICES,
    POINTS,
    POINTS_OUT,
    SIZE,
    kernel,
)
from pns_common.geometry.corner_normals import NO_DIRECTION


@kernel(SIZE, POINTS, INDICES, SIZE, SIZE, POINTS_OUT, POINTS_OUT)
def face_normals(points, faces, begin, end, normals, sides):
    """Write the unit normals of faces begin … end − 1, and what their angles follow from.

    Args:
        normals: (F, 3), out; zeros where there is no area.
        sides: (3, end − begin), out: twice the area, and the inner product of the two sides that
            leave corner a, then corner b.
    """
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        u0, v0, w0 = (
            points[b, 0] - points[a, 0],
            points[c, 0] - points[b, 0],
            points[a, 0] - points[c, 0],
        )
        u1, v1, w1 = (
            points[b, 1] - points[a, 1],
            points[c, 1] - points[b, 1],
            points[a, 1] - points[c, 1],
        )
        u2, v2, w2 = (
            points[b, 2] - points[a, 2],
            points[c, 2] - points[b, 2],
            points[a, 2] - points[c, 2],
        )
        x, y, z = w1 * u2 - w2 * u1, w2 * u0 - w0 * u2, w0 * u1 - w1 * u0
        twice_area = math.sqrt(x * x + y * y + z * z)
        length = twice_area if twice_area > 0 else 1.0
        normals[f, 0], normals[f, 1], normals[f, 2] = x / length, y / length, z / length
        sides[0, f - begin] = twice_area
        sides[1, f - begin] = -(u0 * w0 + u1 * w1 + u2 * w2)
        sides[2, f - begin] = -(v0 * u0 + v1 * u1 + v2 * u2)
    return 0


@kernel(SIZE, POINTS, POINTS, INDICES, POINTS_OUT)
def sum_corners(normals, angles, groups, total):
    """Add the faces' normals, times their angles (2, F) at a and b, to their corners' groups."""
    # All corners a, then all b, then all c: numpy's order of summation.
    for corner in range(3):
        for f in range(groups.shape[0]):
            angle = angles[0, f]
            if corner == 1:
                angle = angles[1, f]
            elif corner == 2:
                angle = math.pi - angles[0, f] - angles[1, f]
            g = groups[f, corner]
            total[g, 0] += angle * normals[f, 0]
            total[g, 1] += angle * normals[f, 1]
            total[g, 2] += angle * normals[f, 2]
    return 0


@kernel(SIZE, SIZE, SIZE, POINTS_OUT)
def scale_to_unit(begin, end, total):
    """Scale rows begin … end − 1 to length 1; to zeros where they have no direction."""
    for g in range(begin, end):
        x, y, z = total[g, 0], total[g, 1], total[g, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > NO_DIRECTION:
            total[g, 0], total[g, 1], total[g, 2] = x / length, y / length, z / length
        else:
            total[g, 0], total[g, 1], total[g, 2] = 0.0, 0.0, 0.0
    return 0
