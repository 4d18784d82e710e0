"""Catmull–Clark's masks (Catmull and Clark 1978) on polygons, with sharp and soft edges.

Sums around a vertex run over its corners in ascending order: each thread owns a range of vertices
and reads all corners.
"""

from __future__ import annotations

from pns_common.kernels import inlined, kernel
from pns_common.kernels.connectivity import (
    INTERIOR,
    SKIPPED_ROWS,
    following_corner,
    preceding_corner,
)
from pns_common.kernels.loop import MIDPOINT

# Each of both ends and both face vertices.
EDGE_SHARE = 1 / 4
# A vertex of fewer corners than this stays: the smooth rule has a negative weight there.
LEAST_CORNERS = 2


@inlined
def face_of(h, face_of_corner):
    """Return the face of a corner."""
    return face_of_corner[h] if len(face_of_corner) else h // 3


@kernel
def place_faces(points, corners, offsets, begin, end, placed):
    """Write the vertices of faces begin … end − 1: the means of their corners."""
    for f in range(max(begin, 0), end):
        first, stop = offsets[f], offsets[f + 1]
        x, y, z = 0.0, 0.0, 0.0
        for h in range(first, stop):
            v = corners[h]
            x += points[v, 0]
            y += points[v, 1]
            z += points[v, 2]
        count = stop - first
        placed[f, 0], placed[f, 1], placed[f, 2] = x / count, y / count, z / count


@kernel
def place_edges(
    points, at_faces, edges, half_edges, face_of_corner, edge_class, soft, begin, end, placed
):
    """Write the vertices of edges begin … end − 1: the smooth rule's if interior, else the middle.

    An edge of sharpness w gets (1 − w) the smooth rule's + w the middle.

    Args:
        at_faces: (F, 3) the vertices of the faces.
        soft: (E,) w; (0,) where no interior edge is soft.
    """
    for e in range(max(begin, 0), end):
        a, b = edges[e, 0], edges[e, 1]
        if edge_class[e] != INTERIOR:
            for k in range(3):
                placed[e, k] = MIDPOINT * (points[a, k] + points[b, k])
            continue
        f = face_of(half_edges[e, 0], face_of_corner)
        g = face_of(half_edges[e, 1], face_of_corner)
        w = soft[e] if len(soft) else 0.0
        for k in range(3):
            ends = points[a, k] + points[b, k]
            smooth = EDGE_SHARE * (ends + (at_faces[f, k] + at_faces[g, k]))
            placed[e, k] = (1 - w) * smooth + w * (MIDPOINT * ends) if w > 0 else smooth


@kernel
def sum_corners(
    points, at_faces, corners, offsets, face_of_corner, reach, begin, end, sums, counts
):
    """Sum over the corners at vertices begin … end − 1; write how many there are.

    A corner adds its face's vertex, and half of both neighbours along its face. ``reach`` is that
    of blocks of 3 × SKIPPED_ROWS corners.
    """
    for v in range(max(begin, 0), end):
        counts[v] = 0
        for k in range(3):
            sums[v, k] = 0.0
    for block in range(reach.shape[0]):
        if reach[block, 1] < begin or reach[block, 0] >= end:
            continue
        start = 3 * SKIPPED_ROWS * block
        for h in range(start, min(start + 3 * SKIPPED_ROWS, corners.shape[0])):
            v = corners[h]
            if not begin <= v < end:
                continue
            a = corners[preceding_corner(h, offsets, face_of_corner)]
            b, f = corners[following_corner(h, offsets, face_of_corner)], face_of(h, face_of_corner)
            counts[v] += 1
            for k in range(3):
                sums[v, k] += MIDPOINT * (points[a, k] + points[b, k]) + at_faces[f, k]


@kernel
def blend_corners(points, counts, begin, end, sums):
    """Turn sums over k corners into the smooth vertices begin … end − 1: (k − 2)/k p + sum/k²."""
    for v in range(max(begin, 0), end):
        count = counts[v]
        for k in range(3):
            if count < LEAST_CORNERS:
                sums[v, k] = points[v, k]
            else:
                sums[v, k] = ((count - 2) * points[v, k] + sums[v, k] / count) / count
