"""Bounds of linear functions on patches of a Catmull–Clark surface, and on their sides.

A patch lies in the convex hull of the control points around its quad. In each of its points the
quad's own four have at least half of the weight, and what lies beyond edges of sharpness w has
1 − w at most (docs/explanation/adaptive.md). So a function whose largest value is i at those four,
o at others on this side, and b beyond is at most

    i / 2 + (1/2 − δ) max(i, o) + δ max(i, o, b)      δ = min(1 − w, 1/2)

and the like from below. On a sharp curve that holds of both ends, others along it, and the rest.
"""

from __future__ import annotations

import math

from pns_common.kernels import (
    f8_1d,
    f8_2d,
    i1_1d,
    i4_2d,
    i8_1d,
    i8_2d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.flatness import HALF, across, blended
from pns_common.kernels.vectors import difference, dot, norm, row

QUAD = 4
# Of both rules of a vertex: how far it follows curves or corners, and curves alone.
SHARP, CURVE = 0, 1


@inlined
def turned(h, by):
    """Return a corner of the quad of another one, so many corners later."""
    return h - h % QUAD + (h + by) % QUAD


@inlined
def value(points, v, origin, direction):
    """Return the height of a point; without a direction, its distance."""
    away = difference(row(points, v), origin)
    if direction[0] == 0 and direction[1] == 0 and direction[2] == 0:
        return norm(away)
    return dot(away, direction)


@inlined
def reach(points, corners, h, origin, direction, low, high):
    """Return a range with the values at the other corners of a quad in it."""
    for by in range(1, QUAD):
        z = value(points, corners[turned(h, by)], origin, direction)
        low, high = min(low, z), max(high, z)
    return low, high


@inlined
def reach_all(points, corners, around, starts, v, origin, direction, low, high):
    """Return a range with the values at all quads of a vertex in it."""
    for j in range(starts[v], starts[v + 1]):
        low, high = reach(points, corners, around[j], origin, direction, low, high)
    return low, high


@inlined
def reach_curve(points, rules, neighbours, v, origin, direction, low, high):
    """Return a range with the values at both neighbours along a curve in it."""
    if rules[v, CURVE] > 0:
        for j in range(2):
            z = value(points, neighbours[v, j], origin, direction)
            low, high = min(low, z), max(high, z)
    return low, high


@kernel
def bound_patches(
    points: f8_2d,
    corners: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    sharpness: f8_1d,
    rules: f8_2d,
    neighbours: u4_2d,
    around: i8_1d,
    starts: i8_1d,
    offsets: i8_1d,
    quads: i8_1d,
    frames: f8_2d,
    inside: bool,
    begin: int,
    end: int,
    to: f8_2d,
):
    """Write bounds of heights of patches begin … end − 1.

    Args:
        points: control points.
        corners, corner_edges, half_edges, edge_class: a mesh of quads.
        sharpness: (E,) of edges, 1 where there are not two faces.
        rules: (V, 2) how far each vertex follows curves or corners, and curves alone.
        neighbours: (V, 2) along the curve.
        around, starts: (H,), (V + 1,) the corners at each vertex.
        offsets, quads: (N + 1,), (M,) the quads that each patch is made of.
        frames: (N, 6) a point and the direction of heights; 0: distances from the point.
        inside: the third corner of each quad has none but a patch's own quads around it.
        begin, end: which patches.
        to: (N, 2) out: the least and the largest height.
    """
    for i in range(begin, end):
        origin = frames[i, 0], frames[i, 1], frames[i, 2]
        direction = frames[i, 3], frames[i, 4], frames[i, 5]
        low, high, least, most = math.inf, -math.inf, math.inf, -math.inf
        under, over_it, loose = math.inf, -math.inf, 0.0
        for j in range(offsets[i], offsets[i + 1]):
            for c in range(QUAD):
                h = QUAD * quads[j] + c
                v = corners[h]
                z = value(points, v, origin, direction)
                low, high = min(low, z), max(high, z)
                if inside and c == 2:
                    continue
                least, most = reach_curve(
                    points, rules, neighbours, v, origin, direction, least, most
                )
                # Both ways around the vertex, up to sharp edges.
                at, count, far = h, 1, -1.0
                least, most = reach(points, corners, at, origin, direction, least, most)
                while True:
                    there = turned(at, 3)
                    e = corner_edges[there]
                    if sharpness[e] > HALF:
                        far = 1 - sharpness[e]
                        break
                    at = across(corner_edges, half_edges, edge_class, there)
                    if at == h:
                        break
                    count += 1
                    least, most = reach(points, corners, at, origin, direction, least, most)
                if far < 0:
                    if count < starts[v + 1] - starts[v]:  # several fans
                        least, most = reach_all(
                            points, corners, around, starts, v, origin, direction, least, most
                        )
                    continue
                at = h
                while True:
                    e = corner_edges[at]
                    if sharpness[e] > HALF:
                        far = max(far, 1 - sharpness[e])
                        break
                    at = turned(across(corner_edges, half_edges, edge_class, at), 1)
                    least, most = reach(points, corners, at, origin, direction, least, most)
                far = max(far, 1 - rules[v, SHARP])
                if far > 0:
                    loose = max(loose, far)
                    under, over_it = reach_all(
                        points, corners, around, starts, v, origin, direction, under, over_it
                    )
        to[i, 0] = -blended(-low, -least, -under, HALF, loose)
        to[i, 1] = blended(high, most, over_it, HALF, loose)


@kernel
def bound_sides(
    points: f8_2d,
    corners: u4_1d,
    corner_edges: u4_1d,
    sharpness: f8_1d,
    rules: f8_2d,
    neighbours: u4_2d,
    around: i8_1d,
    starts: i8_1d,
    parts: i8_2d,
    frames: f8_2d,
    begin: int,
    end: int,
    to: f8_1d,
):
    """Write bounds of the distance of sides begin … end − 1 of patches from straight lines.

    Args:
        points … starts: as of ``bound_patches``.
        parts: (N, M) the corners that the parts of each side leave.
        frames: (N, 9) a point of the line and two directions across it.
        begin, end: which sides.
        to: (N,) out.
    """
    for i in range(begin, end):
        origin, away = (frames[i, 0], frames[i, 1], frames[i, 2]), 0.0
        for k in range(3, 9, 3):
            direction = frames[i, k], frames[i, k + 1], frames[i, k + 2]
            low, high, least, most = math.inf, -math.inf, math.inf, -math.inf
            under, over_it, loose = math.inf, -math.inf, 0.0
            for j in range(parts.shape[1]):
                h = parts[i, j]
                loose = max(loose, 1 - sharpness[corner_edges[h]])
                for by in range(2):
                    v = corners[turned(h, by)]
                    z = value(points, v, origin, direction)
                    low, high = min(low, z), max(high, z)
                    least, most = reach_curve(
                        points, rules, neighbours, v, origin, direction, least, most
                    )
                    loose = max(loose, 1 - rules[v, SHARP])
                    if loose > 0:
                        under, over_it = reach_all(
                            points, corners, around, starts, v, origin, direction, under, over_it
                        )
            # The ends of a side that is no sharp curve need not have half of the weight.
            own = HALF if loose <= HALF else 0.0
            loose = loose if loose <= HALF else 1.0
            down = -blended(-low, -least, -under, own, loose)
            up = blended(high, most, over_it, own, loose)
            away += max(-down, up) ** 2
        to[i] = math.sqrt(away)
