"""Sectors around vertices, and the limits of Loop subdivision that are read along them.

A sector holds the corners around a vertex between two edges that are not interior, anticlockwise;
or all corners of a closed fan. Its neighbours are q_0 … q_k for k corners: corner j lies between
q_j and q_{j+1}. In a closed sector q_k = q_0.
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
    inlined,
    kernel,
    u4_1d,
)
from pns_common.kernels.connectivity import INTERIOR, following_corner, preceding_corner
from pns_common.kernels.vectors import between, cross, divisor, dot, norm, over, row

# Tangents that span less than this, of the product of their lengths, span no plane.
NO_PLANE = 1e-9
# A sum of unit vectors below this, of the sum of their lengths, is what rounding leaves.
CANCELLED = 1e-9


@inlined
def opposed(corner_edges, half_edges, edge_class, h):
    """Return the other half-edge of an interior edge; −1 at other edges."""
    e = corner_edges[h]
    if edge_class[e] != INTERIOR:
        return -1
    first = half_edges[e, 0]
    return half_edges[e, 1] if first == h else first


@kernel
def label_sectors(
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    of_corner: i4_1d,
    first: i4_1d,
    size: i4_1d,
):
    """Find the sectors, open ones first; return how many are open, and how many there are.

    Args:
        of_corner: (H,) out: the sector of each corner; −1 on entry.
        first: (H,) out: the first corner of each sector.
        size: (H,) out: how many corners each sector has.
    """
    count, opened = 0, 0
    for closed in (False, True):
        for start in range(of_corner.shape[0]):
            if of_corner[start] >= 0:
                continue
            if not closed and opposed(corner_edges, half_edges, edge_class, start) >= 0:
                continue
            h, corners = start, 0
            while h >= 0 and of_corner[h] < 0:
                of_corner[h] = count
                corners += 1
                before = preceding_corner(h, offsets, face_of_corner)
                h = opposed(corner_edges, half_edges, edge_class, before)
            first[count], size[count] = start, corners
            count += 1
        if not closed:
            opened = count
    return opened, count


@kernel
def sector_normals(
    points: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
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
        first, size: (S,) from ``label_sectors``.
        at: (S,) where the tangent masks of each sector begin in ``masks``.
        masks: (M, 2) weights of q_0 … q_k, less p, in both tangents.
        outwards: (S,) sectors whose normal must agree with the area around the vertex.
        to: (S, 3) out; 0 without area.
    """
    for s in range(begin, end):
        p, h, before = corners[first[s]], first[s], first[s]
        u, v, area, last = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for j in range(size[s] + 1):
            far = corners[following_corner(h, offsets, face_of_corner) if j < size[s] else before]
            spoke = between(points, p, far)
            u = add(u, masks[at[s] + j, 0], spoke)
            v = add(v, masks[at[s] + j, 1], spoke)
            area = add(area, 1.0, cross(last, spoke))
            last = spoke
            if j < size[s]:
                before = preceding_corner(h, offsets, face_of_corner)
                h = opposed(corner_edges, half_edges, edge_class, before)
        normal = normal_of(u, v, area, outwards[s])
        for k in range(3):
            to[s, k] = normal[k]


@inlined
def normal_of(u, v, area, outward):
    """Return the unit normal of tangents, on the area's side if ``outward``."""
    # Without a plane, that of the area.
    normal = cross(u, v)
    if outward and dot(normal, area) < 0:
        normal = -normal[0], -normal[1], -normal[2]
    if not norm(normal) > NO_PLANE * norm(u) * norm(v):
        normal = area
    return over(normal, divisor(normal))


@inlined
def add(sums, weight, v):
    """Return sums + weight v."""
    return sums[0] + weight * v[0], sums[1] + weight * v[1], sums[2] + weight * v[2]


@kernel
def mean_of_sectors(normals: f8_2d, vertices: u4_1d, to: f8_2d, lengths: f8_1d):
    """Write the unit mean of the normals of each vertex's sectors; 0 where they cancel.

    ``to`` (V, 3) and ``lengths`` (V,) are 0 on entry.
    """
    for s in range(normals.shape[0]):
        v = vertices[s]
        lengths[v] += norm(row(normals, s))
        for k in range(3):
            to[v, k] += normals[s, k]
    for v in range(to.shape[0]):
        mean = row(to, v)
        length = divisor(mean) if norm(mean) > CANCELLED * lengths[v] else 0.0
        for k in range(3):
            to[v, k] = mean[k] / length if length > 0 else 0.0


@kernel
def sum_darts(
    points: f8_2d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    first: i4_1d,
    size: i4_1d,
    at: i8_1d,
    weights: f8_1d,
    rows: i8_1d,
    sums: f8_2d,
    total: f8_1d,
):
    """Add the weighted spokes of darts.

    Args:
        rows: (N,) the sectors of darts, ascending.
        at: (N,) where the weights of q_0 … q_{k−1} begin, of each of these.
        sums: (V, 3) in and out: of the weights times the spokes.
        total: (V,) in and out: of the weights.
    """
    for i in range(rows.shape[0]):
        h, p = first[rows[i]], corners[first[rows[i]]]
        for j in range(size[rows[i]]):
            weight, far = weights[at[i] + j], corners[following_corner(h, offsets, face_of_corner)]
            total[p] += weight
            for k in range(3):
                sums[p, k] += weight * (points[far, k] - points[p, k])
            before = preceding_corner(h, offsets, face_of_corner)
            h = opposed(corner_edges, half_edges, edge_class, before)
