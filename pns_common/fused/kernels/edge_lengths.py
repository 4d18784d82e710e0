"""Lengths of edges: each is measured once, for all the stencils that it is a side of."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import INDICES, NUMBERS_OUT, POINTS, SIZE, kernel, natural
from pns_common.fused.kernels.rings import between, norm


@kernel(SIZE, POINTS, INDICES, SIZE, SIZE, NUMBERS_OUT)
def measure_lengths(points, edges, begin, end, lengths):
    """Write h of edges begin … end − 1."""
    for e in range(natural(begin), end):
        lengths[e] = norm(between(points, edges[e, 0], edges[e, 1]))
    return 0
