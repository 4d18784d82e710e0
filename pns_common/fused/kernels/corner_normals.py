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


@kernel(SIZE, POINTS, INDICES, INDICES, SIZE, SIZE, POINTS_OUT, POINTS_OUT)
def triangle_normals(points, faces, triangles, begin, end, normals, sides):
    """Write the triangles' unit normals, and what their angles follow from.

    Args:
        faces: (F, T) points, of which rows begin … end − 1 are read.
        triangles: (D, 3) columns that a face's triangles have at their corners; n in all.
        normals: (n, 3), out; zeros where there is no area.
        sides: (3, n), out: twice the area, and the inner product of the two sides that leave corner
            a, then corner b.
    """
    i = 0
    for f in range(begin, end):
        for d in range(triangles.shape[0]):
            a, b, c = (
                faces[f, triangles[d, 0]],
                faces[f, triangles[d, 1]],
                faces[f, triangles[d, 2]],
            )
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
            normals[i, 0], normals[i, 1], normals[i, 2] = x / length, y / length, z / length
            sides[0, i] = twice_area
            sides[1, i] = -(u0 * w0 + u1 * w1 + u2 * w2)
            sides[2, i] = -(v0 * u0 + v1 * u1 + v2 * u2)
            i += 1
    return 0


@kernel(SIZE, POINTS, POINTS, INDICES, INDICES, SIZE, SIZE, POINTS_OUT)
def sum_corners(normals, angles, groups, triangles, begin, end, total):
    """Add the triangles' normals to those groups begin … end − 1 that their corners are of.

    Each counts as much as its angle there: ``angles`` (2, n) are those at a and b. ``groups`` are
    of the faces' points (F, T).
    """
    # All corners a, then all b, then all c: numpy's order of summation.
    for corner in range(3):
        i = 0
        for f in range(groups.shape[0]):
            for d in range(triangles.shape[0]):
                g = groups[f, triangles[d, corner]]
                if begin <= g < end:
                    angle = angles[0, i]
                    if corner == 1:
                        angle = angles[1, i]
                    elif corner == 2:
                        angle = math.pi - angles[0, i] - angles[1, i]
                    total[g, 0] += angle * normals[i, 0]
                    total[g, 1] += angle * normals[i, 1]
                    total[g, 2] += angle * normals[i, 2]
                i += 1
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
