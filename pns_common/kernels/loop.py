"""Loop's masks (Loop 1987; equations 2 and 3 of the paper), with sharp and soft edges.

Sums around a vertex run over its edges in ascending order: each thread owns a range of vertices and
reads all edges.
"""

from __future__ import annotations

from pns_common.kernels import (
    Connectivity,
    f8_1d,
    f8_2d,
    i1_1d,
    i4_1d,
    i8_1d,
    i8_2d,
    inlined,
    kernel,
    u4_2d,
)
from pns_common.kernels.connectivity import INTERIOR, SKIPPED_ROWS, opposite, rows_of_block

EDGE_ENDPOINT, EDGE_OPPOSITE = 3 / 8, 1 / 8
MIDPOINT = 1 / 2
CURVE_CENTRE, CURVE_NEIGHBOUR = 3 / 4, 1 / 8


@kernel
def place_edges(
    begin: int, end: int, points: f8_2d, mesh: Connectivity, soft: f8_1d, placed: f8_2d
):
    """Write the vertices of edges begin … end − 1: Loop's if interior, else the midpoint.

    An edge of sharpness w gets (1 − w) Loop's + w the midpoint. ``soft`` is (0,) where no interior
    edge is soft.
    """
    for e in range(max(begin, 0), end):
        a, b = mesh.edges[e, 0], mesh.edges[e, 1]
        if mesh.edge_class[e] == INTERIOR:
            c = opposite(mesh.corners, mesh.half_edges[e, 0])
            d = opposite(mesh.corners, mesh.half_edges[e, 1])
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
    begin: int, end: int, points: f8_2d, edges: u4_2d, reach: i8_2d, sums: f8_2d, valence: i4_1d
):
    """Write the sums of neighbours, and the valences, of vertices begin … end − 1."""
    for v in range(max(begin, 0), end):
        valence[v] = 0
        for k in range(3):
            sums[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, stop = rows_of_block(reach, block, SKIPPED_ROWS, edges.shape[0], begin, end)
        for e in range(first, stop):
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
def blend_rings(begin: int, end: int, points: f8_2d, valence: i4_1d, beta: f8_1d, sums: f8_2d):
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
