"""Normals of groups of corners, with the bits of ``pns_common.geometry.corner_normals``."""

from __future__ import annotations

import math

from pns_common.fused.kernels.angles import angle_between
from pns_common.fused.kernels.compiled import (
    INDICES,
    POINTS,
    POINTS_OUT,
    SIZE,
    kernel,
)
from pns_common.geometry.corner_normals import NO_DIRECTION


@kernel(SIZE, POINTS, INDICES, INDICES, SIZE, SIZE, POINTS_OUT)
def measure_triangles(points, faces, triangles, begin, end, measured):
    """Write the area vectors of the triangles of faces begin … end − 1, and products of sides.

    Args:
        faces: (F, T) points.
        triangles: (D, 3) columns that a face's triangles have at their corners; n in all.
        measured: (6, n), out: the area vector, the inner product of the two sides that leave corner
            a, then corner b. The last row is left.
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
            measured[0, i] = w1 * u2 - w2 * u1
            measured[1, i] = w2 * u0 - w0 * u2
            measured[2, i] = w0 * u1 - w1 * u0
            measured[3, i] = -(u0 * w0 + u1 * w1 + u2 * w2)
            measured[4, i] = -(v0 * u0 + v1 * u1 + v2 * u2)
            i += 1
    return 0


@kernel(SIZE, POINTS_OUT)
def normals_and_angles(measured):
    """Turn what was measured of n triangles into unit normals and angles, without a branch.

    Args:
        measured: (6, n) in and out: the normal, zeros where there is no area; the angles at a and
            b; twice the area.
    """
    for i in range(measured.shape[1]):
        x, y, z = measured[0, i], measured[1, i], measured[2, i]
        twice_area = math.sqrt(x * x + y * y + z * z)
        length = twice_area if twice_area > 0 else 1.0
        measured[0, i], measured[1, i], measured[2, i] = x / length, y / length, z / length
        measured[5, i] = twice_area
    for corner in range(3, 5):
        for i in range(measured.shape[1]):
            measured[corner, i] = angle_between(measured[5, i], measured[corner, i])
    return 0


@kernel(SIZE, POINTS, INDICES, INDICES, SIZE, SIZE, POINTS_OUT)
def add_corners(measured, groups, triangles, begin, end, total):
    """Add the normals of the triangles of faces begin … end − 1 to the groups of their corners.

    Each counts as much as its angle there. Threads take turns, in the order of faces.

    Args:
        measured: of these faces' triangles alone.
        groups: (F, T) of the faces' points.
    """
    i = 0
    for f in range(begin, end):
        for d in range(triangles.shape[0]):
            at_a, at_b = measured[3, i], measured[4, i]
            at_c = math.pi - at_a - at_b
            x, y, z = measured[0, i], measured[1, i], measured[2, i]
            a, b, c = (
                groups[f, triangles[d, 0]],
                groups[f, triangles[d, 1]],
                groups[f, triangles[d, 2]],
            )
            total[a, 0] += at_a * x
            total[a, 1] += at_a * y
            total[a, 2] += at_a * z
            total[b, 0] += at_b * x
            total[b, 1] += at_b * y
            total[b, 2] += at_b * z
            total[c, 0] += at_c * x
            total[c, 1] += at_c * y
            total[c, 2] += at_c * z
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
