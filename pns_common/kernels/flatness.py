"""Bounds of the distance of patches of a subdivision surface from flat triangles.

A patch lies in the convex hull of the control points that its masks read. In each of its points
the triangle's own three have at least half of the weight, and what lies beyond edges of sharpness w
has 1 − w at most (docs/explanation/adaptive.md). So a linear function whose largest value is i at
those three, o at others on this side, and b beyond is at most

    i / 2 + (1/2 − δ) max(i, o) + δ max(i, o, b)      δ = min(1 − w, 1/2)

and the like from below. On a sharp curve both ends have two thirds of the weight.
"""

from __future__ import annotations

import math

from pns_common.kernels import (
    f8_1d,
    f8_2d,
    i1_1d,
    i4_1d,
    i4_2d,
    i8_1d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.vectors import (
    cross,
    difference,
    divisor,
    dot,
    norm,
    normal_and_area,
    over,
    row,
)

# Of a slab: from the triangle's plane; then, for each side, along the normal and across the side.
COLUMNS = 14
# What vertices do: follow all that is around them, follow a sharp curve, or stay.
FREE, ON_CURVE, STAYS = 0, 1, 2
# The least weight that the ends of a curve have on it, and the corners of a face on its patch.
OF_ENDS, OF_CORNERS = 2 / 3, 1 / 2
HALF = 1 / 2


@inlined
def blended(inner, outer, beyond, own, loose):
    """Return the largest value where inner ones weigh ``own`` or more, and those beyond little."""
    here = max(inner, outer)
    if loose == 0:
        return own * inner + (1 - own) * here
    far = min(loose, 1 - own)
    return own * inner + (1 - own - far) * here + far * max(here, beyond)


@kernel
def measure_slabs(
    points: f8_2d,
    corners: u4_1d,
    group: i4_1d,
    starts: i8_1d,
    members: i8_1d,
    loose: f8_1d,
    of_vertices: i8_1d,
    around: i8_1d,
    moves: i1_1d,
    curve: u4_2d,
    slack: f8_1d,
    rows: i8_1d,
    triangles: f8_2d,
    sides: i4_2d,
    softness: f8_2d,
    begin: int,
    end: int,
    to: f8_2d,
):
    """Write bounds of patches begin … end − 1 from triangles that stand for them.

    Args:
        points: control points.
        corners: vertices of the faces, three each.
        group: (H,) which corners each corner's vertex reads: ``members[starts[g]:starts[g + 1]]``.
        loose: (H,) how much weight what lies beyond that group can have.
        of_vertices, around: as ``starts`` and ``members``, all corners of each vertex.
        moves: (V,) FREE, ON_CURVE or STAYS.
        curve: (V, 2) neighbours of vertices on curves.
        slack: (V,) how much weight all else around can have at these and at those that stay.
        rows: (N,) faces.
        triangles: (3 N, 3) corners of the triangles.
        sides: (N, 3) the triangle's side that each side of a face, from its corner on, is to be
            compared with as a curve; −1: none.
        softness: (N, 3) 1 − w of each side.
        to: (N, 14) out: low and high, 0 among them, for each function of ``COLUMNS``.
    """
    for i in range(begin, end):
        p, q, r = row(triangles, 3 * i), row(triangles, 3 * i + 1), row(triangles, 3 * i + 2)
        n, _, _ = normal_and_area(p, q, r)
        flat = n[0] != 0 or n[1] != 0 or n[2] != 0
        for k in range(COLUMNS):
            to[i, k] = 0.0
        low, high, least, most = math.inf, -math.inf, math.inf, -math.inf
        under, over_it, far = math.inf, -math.inf, 0.0
        for k in range(3):
            h = 3 * rows[i] + k
            d = difference(row(points, corners[h]), p)
            z = dot(n, d) if flat else norm(d)
            low, high = min(low, z), max(high, z)
            for j in range(starts[group[h]], starts[group[h] + 1]):
                at = members[j] - members[j] % 3
                for m in range(3):
                    d = difference(row(points, corners[at + m]), p)
                    z = dot(n, d) if flat else norm(d)
                    least, most = min(least, z), max(most, z)
            if loose[h] > 0:
                far = max(far, loose[h])
                for j in range(of_vertices[corners[h]], of_vertices[corners[h] + 1]):
                    at = around[j] - around[j] % 3
                    for m in range(3):
                        d = difference(row(points, corners[at + m]), p)
                        z = dot(n, d) if flat else norm(d)
                        under, over_it = min(under, z), max(over_it, z)
        if not flat:
            # No plane: the distance from a corner is convex.
            to[i, 1] = max(high, most, over_it)
            continue
        to[i, 0] = min(-blended(-low, -least, -under, OF_CORNERS, far), 0.0)
        to[i, 1] = max(blended(high, most, over_it, OF_CORNERS, far), 0.0)
        for k in range(3):
            s = sides[i, k]
            if s < 0:
                continue
            origin = p if s == 0 else (q if s == 1 else r)
            target = q if s == 0 else (r if s == 1 else p)
            along = difference(target, origin)
            across = cross(over(along, divisor(along)), n)
            smooth = softness[i, k] > HALF
            own, far = OF_CORNERS if smooth else OF_ENDS, 0.0 if smooth else softness[i, k]
            zl, zh, yl, yh = math.inf, -math.inf, math.inf, -math.inf
            zo, zm, yo, ym = math.inf, -math.inf, math.inf, -math.inf
            zu, zv, yu, yv = math.inf, -math.inf, math.inf, -math.inf
            for side in range(2):
                v = corners[3 * rows[i] + (k + side) % 3]
                d = difference(row(points, v), origin)
                z, y = dot(n, d), dot(across, d)
                zl, zh, yl, yh = min(zl, z), max(zh, z), min(yl, y), max(yh, y)
                if moves[v] == FREE:
                    own = OF_CORNERS
                elif not smooth:
                    far = max(far, slack[v])
                    for m in range(2 if moves[v] == ON_CURVE else 0):
                        d = difference(row(points, curve[v, m]), origin)
                        z, y = dot(n, d), dot(across, d)
                        zo, zm, yo, ym = min(zo, z), max(zm, z), min(yo, y), max(ym, y)
                if smooth or moves[v] == FREE or far > 0:
                    for j in range(of_vertices[v], of_vertices[v + 1]):
                        at = around[j] - around[j] % 3
                        for m in range(3):
                            d = difference(row(points, corners[at + m]), origin)
                            z, y = dot(n, d), dot(across, d)
                            zu, zv, yu, yv = min(zu, z), max(zv, z), min(yu, y), max(yv, y)
                            if smooth or moves[v] == FREE:
                                zo, zm, yo, ym = min(zo, z), max(zm, z), min(yo, y), max(ym, y)
            to[i, 2 + 4 * s] = min(-blended(-zl, -zo, -zu, own, far), 0.0)
            to[i, 3 + 4 * s] = max(blended(zh, zm, zv, own, far), 0.0)
            to[i, 4 + 4 * s] = min(-blended(-yl, -yo, -yu, own, far), 0.0)
            to[i, 5 + 4 * s] = max(blended(yh, ym, yv, own, far), 0.0)
