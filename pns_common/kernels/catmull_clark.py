"""Catmull–Clark's masks (Catmull and Clark 1978) on polygons, with sharp and soft edges.

Sums around a vertex run over its corners in ascending order: each thread owns a range of vertices
and reads all corners.
"""

from __future__ import annotations

from pns_common.kernels import (
    b1_1d,
    f8_1d,
    f8_2d,
    i1_1d,
    i4_1d,
    i4_2d,
    i8_1d,
    i8_2d,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.connectivity import (
    INTERIOR,
    SKIPPED_ROWS,
    face_of,
    following_corner,
    preceding_corner,
)
from pns_common.kernels.limit import add, normal_of, opposed
from pns_common.kernels.loop import MIDPOINT
from pns_common.kernels.vectors import between, cross

# Each of both ends and both face vertices.
EDGE_SHARE = 1 / 4
# A vertex of fewer corners than this stays: the smooth rule has a negative weight there.
LEAST_CORNERS = 2
# A neighbour's weight in the limit mask, in units of an opposite corner's.
LIMIT_EDGE = 4


@kernel
def place_faces(points: f8_2d, corners: u4_1d, offsets: i4_1d, begin: int, end: int, placed: f8_2d):
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
    points: f8_2d,
    at_faces: f8_2d,
    edges: u4_2d,
    half_edges: i4_2d,
    face_of_corner: u4_1d,
    edge_class: i1_1d,
    soft: f8_1d,
    begin: int,
    end: int,
    placed: f8_2d,
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
    points: f8_2d,
    at_faces: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    reach: i8_2d,
    begin: int,
    end: int,
    sums: f8_2d,
    counts: i4_1d,
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
def blend_corners(points: f8_2d, counts: i4_1d, begin: int, end: int, sums: f8_2d):
    """Turn sums over k corners into the smooth vertices begin … end − 1: (k − 2)/k p + sum/k²."""
    for v in range(max(begin, 0), end):
        count = counts[v]
        for k in range(3):
            if count < LEAST_CORNERS:
                sums[v, k] = points[v, k]
            else:
                sums[v, k] = ((count - 2) * points[v, k] + sums[v, k] / count) / count


# --- limits ---------------------------------------------------------------------------------------
#
# All of the next mesh, whose faces are quads: ``placed`` has its vertices, old ones first, those of
# edges from row V on, those of faces from row V + E on.


@kernel
def sum_limit_corners(
    placed: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    reach: i8_2d,
    edge_count: int,
    begin: int,
    end: int,
    sums: f8_2d,
):
    """Write k² p + 4 Σ e_j + Σ d_j, over its sum k (k + 5), of vertices begin … end − 1."""
    count = sums.shape[0]
    for v in range(max(begin, 0), end):
        sums[v, 0] = sums[v, 1] = sums[v, 2] = sums[v, 3] = 0.0
    for block in range(reach.shape[0]):
        if reach[block, 1] < begin or reach[block, 0] >= end:
            continue
        start = 3 * SKIPPED_ROWS * block
        for h in range(start, min(start + 3 * SKIPPED_ROWS, corners.shape[0])):
            v = corners[h]
            if not begin <= v < end:
                continue
            a = count + corner_edges[preceding_corner(h, offsets, face_of_corner)]
            b, f = count + corner_edges[h], count + edge_count + face_of(h, face_of_corner)
            sums[v, 3] += 1
            for k in range(3):
                sums[v, k] += LIMIT_EDGE / 2 * (placed[a, k] + placed[b, k]) + placed[f, k]
    for v in range(max(begin, 0), end):
        n = sums[v, 3]
        for k in range(3):
            if n < LEAST_CORNERS:
                sums[v, k] = placed[v, k]
            else:
                sums[v, k] = (n * n * placed[v, k] + sums[v, k]) / (n * (n + 5))


@kernel
def sum_darts(
    placed: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    edge_count: int,
    first: i4_1d,
    size: i4_1d,
    at: i8_1d,
    weights: f8_1d,
    rows: i8_1d,
    sums: f8_2d,
    total: f8_1d,
):
    """Add the weighted spokes and diagonals of darts.

    Args:
        rows: (N,) the sectors of darts, ascending.
        at: (N,) where the weights of q_0, d_0, q_1, …, q_k begin, of each of these.
        sums: (V, 3) in and out: of the weights times the points.
        total: (V,) in and out: of the weights.
    """
    count = sums.shape[0]
    for i in range(rows.shape[0]):
        h, p, to = first[rows[i]], corners[first[rows[i]]], at[i]
        for j in range(size[rows[i]]):
            before = preceding_corner(h, offsets, face_of_corner)
            spoke, diagonal = count + corner_edges[h], face_of(h, face_of_corner)
            diagonal += count + edge_count
            last = count + corner_edges[before]
            w, d, ending = weights[to], weights[to + 1], j + 1 == size[rows[i]]
            e = weights[to + 2] if ending else 0.0
            total[p] += w + d + e
            for k in range(3):
                sums[p, k] += w * placed[spoke, k] + d * placed[diagonal, k] + e * placed[last, k]
            to += 2
            h = opposed(corner_edges, half_edges, edge_class, before)


@kernel
def sector_normals(
    placed: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    vertex_count: int,
    edge_count: int,
    first: i4_1d,
    size: i4_1d,
    at: i8_1d,
    masks: f8_2d,
    outwards: b1_1d,
    begin: int,
    end: int,
    to: f8_2d,
):
    """Write the unit normals of the limit surface in sectors begin … end − 1.

    Args:
        first, size: (S,) the first corner of each sector, and how many there are.
        at: (S,) where the tangent masks of each sector begin in ``masks``.
        masks: (M, 2) weights of q_0, d_0, q_1, …, q_k, less p, in both tangents.
        outwards: (S,) sectors whose normal must agree with the area around the vertex.
        to: (S, 3) out; 0 without area.
    """
    for s in range(begin, end):
        p, h, row_of = corners[first[s]], first[s], at[s]
        u, v, area = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        last, before = (0.0, 0.0, 0.0), first[s]
        for j in range(2 * size[s] + 1):
            if j % 2:
                far = edge_count + face_of(h, face_of_corner)
                before = preceding_corner(h, offsets, face_of_corner)
            else:
                if j:
                    h = opposed(corner_edges, half_edges, edge_class, before)
                far = corner_edges[before] if j == 2 * size[s] else corner_edges[h]
            spoke = between(placed, p, vertex_count + far)
            u = add(u, masks[row_of + j, 0], spoke)
            v = add(v, masks[row_of + j, 1], spoke)
            area = add(area, 1.0, cross(last, spoke))
            last = spoke
        normal = normal_of(u, v, area, outwards[s])
        for k in range(3):
            to[s, k] = normal[k]
