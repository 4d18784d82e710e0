"""Catmull–Clark's masks (Catmull and Clark 1978) on polygons, with sharp and soft edges.

Sums around a vertex run over its corners in ascending order: each thread owns a range of vertices
and reads all corners.
"""

from __future__ import annotations

from pns_common.kernels import Connectivity, f8_1d, f8_2d, i4_1d, i8_2d, kernel
from pns_common.kernels.connectivity import (
    INTERIOR,
    SKIPPED_ROWS,
    face_of,
    following_corner,
    preceding_corner,
    rows_of_block,
)
from pns_common.kernels.loop import MIDPOINT

# Each of both ends and both face vertices.
EDGE_SHARE = 1 / 4
# A vertex of fewer corners than this stays: the smooth rule has a negative weight there.
LEAST_CORNERS = 2


@kernel
def place_faces(begin: int, end: int, points: f8_2d, mesh: Connectivity, placed: f8_2d):
    """Write the vertices of faces begin … end − 1: the means of their corners."""
    for f in range(max(begin, 0), end):
        first, stop = mesh.offsets[f], mesh.offsets[f + 1]
        x, y, z = 0.0, 0.0, 0.0
        for h in range(first, stop):
            v = mesh.corners[h]
            x += points[v, 0]
            y += points[v, 1]
            z += points[v, 2]
        count = stop - first
        placed[f, 0], placed[f, 1], placed[f, 2] = x / count, y / count, z / count


@kernel
def place_edges(
    begin: int,
    end: int,
    points: f8_2d,
    at_faces: f8_2d,
    mesh: Connectivity,
    soft: f8_1d,
    placed: f8_2d,
):
    """Write the vertices of edges begin … end − 1: the smooth rule's if interior, else the middle.

    An edge of sharpness w gets (1 − w) the smooth rule's + w the middle.

    Args:
        at_faces: (F, 3) the vertices of the faces.
        soft: (E,) w; (0,) where no interior edge is soft.
    """
    for e in range(max(begin, 0), end):
        a, b = mesh.edges[e, 0], mesh.edges[e, 1]
        if mesh.edge_class[e] != INTERIOR:
            for k in range(3):
                placed[e, k] = MIDPOINT * (points[a, k] + points[b, k])
            continue
        f, g = face_of(mesh, mesh.half_edges[e, 0]), face_of(mesh, mesh.half_edges[e, 1])
        w = soft[e] if len(soft) else 0.0
        for k in range(3):
            ends = points[a, k] + points[b, k]
            smooth = EDGE_SHARE * (ends + (at_faces[f, k] + at_faces[g, k]))
            placed[e, k] = (1 - w) * smooth + w * (MIDPOINT * ends) if w > 0 else smooth


@kernel
def sum_corners(
    begin: int,
    end: int,
    points: f8_2d,
    at_faces: f8_2d,
    mesh: Connectivity,
    reach: i8_2d,
    at_edges: bool,
    weight: float,
    sums: f8_2d,
    counts: i4_1d,
):
    """Sum over the corners at vertices begin … end − 1; write how many there are.

    A corner adds its face's vertex, and ``weight`` times both neighbours along its face: vertices,
    or those of edges if ``at_edges``. ``reach`` is that of blocks of 3 × SKIPPED_ROWS corners.
    """
    for v in range(max(begin, 0), end):
        counts[v] = 0
        for k in range(3):
            sums[v, k] = 0.0
    beside = mesh.corner_edges if at_edges else mesh.corners
    for block in range(reach.shape[0]):
        first, stop = rows_of_block(reach, block, 3 * SKIPPED_ROWS, len(beside), begin, end)
        for h in range(first, stop):
            v = mesh.corners[h]
            if not begin <= v < end:
                continue
            a = beside[preceding_corner(mesh, h)]
            b = beside[h if at_edges else following_corner(mesh, h)]
            f = face_of(mesh, h)
            counts[v] += 1
            for k in range(3):
                sums[v, k] += weight * (points[a, k] + points[b, k]) + at_faces[f, k]


@kernel
def blend_corners(begin: int, end: int, points: f8_2d, counts: i4_1d, sums: f8_2d):
    """Turn sums over k corners into the smooth vertices begin … end − 1: (k − 2)/k p + sum/k²."""
    for v in range(max(begin, 0), end):
        count = counts[v]
        for k in range(3):
            if count < LEAST_CORNERS:
                sums[v, k] = points[v, k]
            else:
                sums[v, k] = ((count - 2) * points[v, k] + sums[v, k] / count) / count
