"""What edges are like, each measured once, with the bits of geometry/rings.py and thin_faces.py."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    CLASSES,
    INDEX,
    INDICES,
    NUMBERS_OUT,
    POINTS,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.rings import AREA
from pns_common.fused.kernels.together import TOGETHER, keep, kept
from pns_common.fused.kernels.vectors import between, cross, difference, dot, row
from pns_common.geometry.thin_faces import OF_ALTITUDES

# What is held of TOGETHER edges, a row of numbers each: the spoke, the normals to its left and to
# its right, the smaller area of both faces, the wider shape of both, or a wide one, and 1 where the
# edge is interior, else 0; then what is made of them in their place.
SPOKE, LEFT, RIGHT, LEAST, SHAPE, INNER, HELD = 0, 3, 6, 9, 10, 11, 12
LENGTH, NETWORK_LENGTH, JUMP, BEND = 0, 1, 2, 3


def _shape(points, starts, f, area):
    """Return the lowest altitude of a face over its longest side."""
    a, b, c = starts[3 * f], starts[3 * f + 1], starts[3 * f + 2]
    first, second, third = between(points, a, b), between(points, b, c), between(points, c, a)
    longest = max(max(dot(first, first), dot(second, second)), dot(third, third))
    return area / (longest if longest > 0 else 1.0)


def _measure(held, altitudes, of_shape):
    """Put h, ℓ, x and s in place of what they are made of, without a branch: it runs on vectors."""
    for lane in range(TOGETHER):
        spoke, inner = kept(held, SPOKE, lane), held[INNER * TOGETHER + lane] > 0
        n, m = kept(held, LEFT, lane), kept(held, RIGHT, lane)
        square = dot(spoke, spoke)
        size = math.sqrt(square)
        length = size if square > 0 else math.inf
        wide = altitudes * held[LEAST * TOGETHER + lane] / length
        share = of_shape * held[SHAPE * TOGETHER + lane]
        chord = difference(n, m)
        known = inner & (dot(n, n) > 0) & (dot(m, m) > 0)
        direction = spoke[0] / length, spoke[1] / length, spoke[2] / length
        # Beside 0 there is no −0 in the array kernels' sums either.
        jump, bend = dot(chord, chord) / 2 + 0.0, dot(cross(n, m), direction) + 0.0
        held[LENGTH * TOGETHER + lane] = size if square > 0 else 0.0
        ell = (wide if wide < size else size) * (share * share if share < 1 else 1.0)
        held[NETWORK_LENGTH * TOGETHER + lane] = ell if inner else size
        held[JUMP * TOGETHER + lane] = jump if known else 0.0
        held[BEND * TOGETHER + lane] = bend if inner else 0.0


@kernel(
    SIZE,
    *(POINTS, POINTS, POINTS, INDEX, INDICES, INDICES, CLASSES, REAL, SIZE, SIZE),
    *(NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT),
)
def measure_edges(
    points,
    normals,
    areas,
    starts,
    edges,
    half_edges,
    edge_class,
    altitudes,
    begin,
    end,
    lengths,
    network_lengths,
    jumps,
    bends,
    held,
):
    """Write h, ℓ, x and s of edges begin … end − 1; x and s are 0 where an edge is not interior.

    Args:
        starts: (3 F,) where each half-edge starts.
        altitudes: α, infinite where the network speaks in units of h whatever the faces.
        held: (HELD TOGETHER,) overwritten: of some edges, one beside the other.
    """
    of_shape = OF_ALTITUDES * altitudes
    for first in range(natural(begin), end, TOGETHER):
        count = min(TOGETHER, end - first)
        for lane in range(TOGETHER):
            e = natural(min(first + lane, end - 1))
            there, back = half_edges[e, 0], half_edges[e, 1]
            inner = edge_class[e] == INTERIOR
            if not inner:
                back = there
            elif starts[there] != edges[e, 0]:
                there, back = back, there
            f, g = there // 3, back // 3
            keep(held, SPOKE, lane, between(points, edges[e, 0], edges[e, 1]))
            keep(held, LEFT, lane, row(normals, f))
            keep(held, RIGHT, lane, row(normals, g))
            left, right = areas[f, AREA], areas[g, AREA]
            held[LEAST * TOGETHER + lane] = min(left, right)
            shape = _shape(points, starts, f, left)
            # Beside a wide face it does not matter how thin the other is.
            if of_shape * shape < 1:
                shape = max(shape, _shape(points, starts, g, right))
            held[SHAPE * TOGETHER + lane] = shape
            held[INNER * TOGETHER + lane] = 1.0 if inner else 0.0
        _measure(held, altitudes, of_shape)
        for lane in range(count):
            lengths[first + lane] = held[LENGTH * TOGETHER + lane]
            network_lengths[first + lane] = held[NETWORK_LENGTH * TOGETHER + lane]
            jumps[first + lane] = held[JUMP * TOGETHER + lane]
            bends[first + lane] = held[BEND * TOGETHER + lane]
    return 0
