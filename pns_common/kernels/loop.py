"""Loop's masks (Loop 1987; equations 2 and 3 of the paper), with sharp and soft edges.

Sums around a vertex run over its edges in ascending order: each thread owns a range of vertices and
reads all edges.
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
    i8_2d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.connectivity import INTERIOR, opposite, skipped_block

EDGE_ENDPOINT, EDGE_OPPOSITE = 3 / 8, 1 / 8
MIDPOINT = 1 / 2
CURVE_CENTRE, CURVE_NEIGHBOUR = 3 / 4, 1 / 8


@kernel
def place_edges(
    points: f8_2d,
    corners: u4_1d,
    edges: u4_2d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    soft: f8_1d,
    begin: int,
    end: int,
    placed: f8_2d,
):
    """Write the vertices of edges begin … end − 1: Loop's if interior, else the midpoint.

    An edge of sharpness w gets (1 − w) Loop's + w the midpoint. ``soft`` is (0,) where no interior
    edge is soft.
    """
    for e in range(max(begin, 0), end):
        a, b = edges[e, 0], edges[e, 1]
        if edge_class[e] == INTERIOR:
            c, d = opposite(corners, half_edges[e, 0]), opposite(corners, half_edges[e, 1])
            for k in range(3):
                ends, sides = points[a, k] + points[b, k], points[c, k] + points[d, k]
                placed[e, k] = EDGE_ENDPOINT * ends + EDGE_OPPOSITE * sides
            if len(soft) and soft[e] > 0:
                for k in range(3):
                    middle = MIDPOINT * (points[a, k] + points[b, k])
                    placed[e, k] = (1 - soft[e]) * placed[e, k] + soft[e] * middle
        else:
            for k in range(3):
                placed[e, k] = MIDPOINT * (points[a, k] + points[b, k])


@kernel
def sum_rings(
    points: f8_2d, edges: u4_2d, reach: i8_2d, begin: int, end: int, sums: f8_2d, valence: i4_1d
):
    """Write the sums of neighbours, and the valences, of vertices begin … end − 1."""
    for v in range(max(begin, 0), end):
        valence[v] = 0
        for k in range(3):
            sums[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, count = skipped_block(edges, reach, block, begin, end)
        for e in range(first, first + count):
            a, b = edges[e, 0], edges[e, 1]
            if begin <= a < end:
                valence[a] += 1
                for k in range(3):
                    sums[a, k] += points[b, k]
            if begin <= b < end:
                valence[b] += 1
                for k in range(3):
                    sums[b, k] += points[a, k]


@kernel
def blend_rings(points: f8_2d, valence: i4_1d, beta: f8_1d, begin: int, end: int, sums: f8_2d):
    """Turn sums of neighbours into Loop's smooth vertices begin … end − 1 (equation 3).

    ``beta``: Loop's weight of one neighbour, for each valence that occurs.
    """
    for v in range(max(begin, 0), end):
        weight = beta[valence[v]]
        centre = 1 - valence[v] * weight
        for k in range(3):
            sums[v, k] = centre * points[v, k] + weight * sums[v, k]


@kernel
def sharpest_edges(edges: u4_2d, edge_class: i1_1d, soft: f8_1d, weights: f8_2d, neighbours: u4_2d):
    """Find the three sharpest edges at each vertex, in descending order of sharpness.

    Args:
        edges: (E, 2).
        soft: (E,) sharpness of interior edges; (0,) for 0 at all. Others have 1.
        weights: (V, 3) out; 0 on entry.
        neighbours: (V, 2) out: the far ends of the two sharpest.
    """
    for e in range(edges.shape[0]):
        if edge_class[e] != INTERIOR:
            w = 1.0
        elif len(soft) and soft[e] > 0:
            w = soft[e]
        else:
            continue
        for side in range(2):
            v, far = edges[e, side], edges[e, 1 - side]
            if w > weights[v, 0]:
                weights[v, 2], weights[v, 1], weights[v, 0] = weights[v, 1], weights[v, 0], w
                neighbours[v, 1], neighbours[v, 0] = neighbours[v, 0], far
            elif w > weights[v, 1]:
                weights[v, 2], weights[v, 1], neighbours[v, 1] = weights[v, 1], w, far
            elif w > weights[v, 2]:
                weights[v, 2] = w


@inlined
def at_sharpness(smooth, curve, stays, second, third):
    """Return (1 − w₂) smooth + (w₂ − w₃) curve + w₃ p: exact for weights 0 and 1."""
    if third >= 1:
        return stays
    if second >= 1 and third == 0:
        return curve
    return (1 - second) * smooth + (second - third) * curve + third * stays


@kernel
def blend_sharp(
    points: f8_2d,
    rows: i8_1d,
    weights: f8_2d,
    neighbours: u4_2d,
    centre: float,
    side: float,
    placed: f8_2d,
):
    """Move the vertices ``rows``, on two or more edges of sharpness above 0.

    The rule of a curve is ``centre`` p + ``side`` (the two neighbours along it). On three sharp
    edges a vertex stays.

    Args:
        placed: (V, 3) in and out: where the smooth rule puts the vertices.
    """
    for v in rows:
        a, b = neighbours[v, 0], neighbours[v, 1]
        for k in range(3):
            curve = centre * points[v, k] + side * (points[a, k] + points[b, k])
            placed[v, k] = at_sharpness(
                placed[v, k], curve, points[v, k], weights[v, 1], weights[v, 2]
            )


@kernel
def find_box(points: f8_2d, low: f8_1d, high: f8_1d):
    """Write the least and the largest of each coordinate; NaN where one is."""
    for k in range(3):
        low[k], high[k] = math.inf, -math.inf
    for v in range(points.shape[0]):
        for k in range(3):
            x = points[v, k]
            if not x >= low[k]:
                low[k] = x
            if not x <= high[k]:
                high[k] = x
            if x != x:
                low[k] = high[k] = x
                return


@kernel
def largest_coordinate(points: f8_2d, begin: int, end: int):
    """Return the largest absolute coordinate of rows begin … end − 1; NaN where one is."""
    largest = 0.0
    for v in range(max(begin, 0), end):
        for k in range(3):
            size = abs(points[v, k])
            if not size <= largest:
                largest = size
                if size != size:
                    return size
    return largest
