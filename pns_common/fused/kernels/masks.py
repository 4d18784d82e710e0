"""Loop's masks on arrays, with the bits of ``pns_common.masks.stencils``.

Sums around a vertex run over its edges in ascending order, whoever computes them: each thread owns
a range of vertices and reads all edges.
"""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    INDEX,
    INDEX_OUT,
    INDICES,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.owned import owned_rows
from pns_common.masks.stencils import (
    CURVE_CENTRE,
    CURVE_NEIGHBOUR,
    EDGE_ENDPOINT,
    EDGE_OPPOSITE,
    MIDPOINT,
)


def opposite(faces, half_edge):
    """Return the vertex of a half-edge's face that is not on it."""
    f = half_edge // 3
    i = half_edge - 3 * f
    return faces[f, i - 1 if i > 0 else 2]


@kernel(SIZE, POINTS, INDICES, INDICES, INDICES, CLASSES, SIZE, SIZE, POINTS_OUT)
def place_edges(points, faces, edges, half_edges, edge_class, begin, end, placed):
    """Write Loop's vertices of edges begin … end − 1 (equation 2); else midpoints."""
    for e in range(natural(begin), end):
        a, b = edges[e, 0], edges[e, 1]
        if edge_class[e] == INTERIOR:
            c, d = opposite(faces, half_edges[e, 0]), opposite(faces, half_edges[e, 1])
            for k in range(3):
                ends, sides = points[a, k] + points[b, k], points[c, k] + points[d, k]
                placed[e, k] = EDGE_ENDPOINT * ends + EDGE_OPPOSITE * sides
        else:
            for k in range(3):
                placed[e, k] = MIDPOINT * (points[a, k] + points[b, k])
    return 0


@kernel(SIZE, POINTS, INDICES, INDICES, SIZE, SIZE, POINTS_OUT, INDEX_OUT)
def sum_rings(points, edges, reach, begin, end, sums, valence):
    """Write sums of neighbours, and valences, of vertices begin … end − 1."""
    for v in range(natural(begin), end):
        valence[v] = 0
        for k in range(3):
            sums[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, asked = owned_rows(edges, reach, block, begin, end)
        for i in range(asked):
            e = first + i
            a, b = edges[e, 0], edges[e, 1]
            if begin <= a < end:
                valence[a] += 1
                for k in range(3):
                    sums[a, k] += points[b, k]
            if begin <= b < end:
                valence[b] += 1
                for k in range(3):
                    sums[b, k] += points[a, k]
    return 0


@kernel(SIZE, POINTS, INDICES, INDEX, INDEX, SIZE, SIZE, POINTS_OUT)
def sum_along_curves(points, edges, sharp_edges, sharp, begin, end, sums):
    """Sum over sharp edges alone at those of vertices begin … end − 1 that have two or more.

    Args:
        sharp_edges: (S,) the edges that are not interior, ascending.
        sharp: (V,) how many there are at each vertex.
        sums: (V, 3) in and out: sums over rings, replaced where they do not count.
    """
    for v in range(natural(begin), end):
        if sharp[v] >= 2:
            for k in range(3):
                sums[v, k] = 0.0
    for e in sharp_edges:
        a, b = edges[e, 0], edges[e, 1]
        if begin <= a < end and sharp[a] >= 2:
            for k in range(3):
                sums[a, k] += points[b, k]
        if begin <= b < end and sharp[b] >= 2:
            for k in range(3):
                sums[b, k] += points[a, k]
    return 0


@kernel(SIZE, POINTS, INDEX, INDEX, NUMBERS, SIZE, SIZE, POINTS_OUT)
def blend_vertices(points, valence, sharp, beta, begin, end, sums):
    """Turn sums of neighbours into the moved old vertices begin … end − 1 (equation 3).

    Args:
        sharp: (V,) sharp edges at each vertex, or (0,) where there are none at all.
        beta: Loop's weight of one neighbour, for each valence that occurs.
    """
    for v in range(natural(begin), end):
        count = sharp[v] if len(sharp) else 0
        if count < 2:
            weight = beta[valence[v]]
            centre = 1 - valence[v] * weight
        elif count == 2:
            weight, centre = CURVE_NEIGHBOUR, CURVE_CENTRE
        else:
            weight, centre = 0.0, 1.0
        for k in range(3):
            sums[v, k] = centre * points[v, k] + weight * sums[v, k]
    return 0


def _largest(points, begin, end):
    largest = 0.0
    for v in range(natural(begin), end):
        for k in range(3):
            size = abs(points[v, k])
            if not size <= largest:
                largest = size
                if size != size:
                    return size
    return largest


@kernel(REAL, POINTS, SIZE, SIZE)
def largest_coordinate(points, begin, end):
    """Return the largest absolute coordinate of rows begin … end − 1; NaN where one is."""
    return _largest(points, begin, end)


@kernel(REAL, POINTS, SIZE, SIZE, SIZE, POINTS_OUT, NUMBERS_OUT)
def add_displacement(displacement, first, begin, end, points, longest):
    """Add δ to rows begin … end − 1 from ``first`` on; return the largest coordinate of all.

    Before ``first`` Loop's rule stands, and nothing is added: not even 0, which makes 0 of −0.

    Args:
        longest: (1,) out: the largest ‖δ‖² of what is added.
    """
    largest = 0.0
    for v in range(max(first, begin), end):
        x, y, z = displacement[v, 0], displacement[v, 1], displacement[v, 2]
        points[v, 0] += x
        points[v, 1] += y
        points[v, 2] += z
        largest = max(largest, x * x + y * y + z * z)
    longest[0] = largest
    return _largest(points, begin, end)
