"""Lines that go on, with the answers of geometry/crease_lines/going_on.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    FLAGS,
    FLAGS_OUT,
    INDEX,
    INDEX_OUT,
    INDICES,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
)
from pns_common.fused.kernels.vectors import between, divisor, dot, row
from pns_common.geometry.crease_lines.going_on import CORNER, ROUNDS


@kernel(SIZE, POINTS, INDICES, INDEX, FLAGS, REAL, INDEX_OUT, POINTS_OUT, FLAGS_OUT)
def drop_loose_ends(points, edges, flat, at_rim, cosine, count, total, left):
    """Mark the edges ``flat`` that are left when those are dropped that do not go on at both ends.

    Args:
        at_rim: (V,) where a line may end.
        count: (V,) 0 on entry and exit: how many lines meet at a vertex.
        total: (V, 3) likewise: the sum of their directions away from there.
        left: (N,) True on entry.
    """
    for _ in range(ROUNDS):
        dropped = 0
        for i in range(len(flat)):
            if left[i]:
                a, b = edges[flat[i], 0], edges[flat[i], 1]
                v = between(points, a, b)
                size = divisor(v)
                count[a] += 1
                count[b] += 1
                for k in range(3):
                    total[a, k] += v[k] / size
                    total[b, k] -= v[k] / size
        for i in range(len(flat)):
            if left[i]:
                a, b = edges[flat[i], 0], edges[flat[i], 1]
                if not (
                    _goes_on(at_rim, count, total, a, cosine)
                    and _goes_on(at_rim, count, total, b, cosine)
                ):
                    left[i] = False
                    dropped += 1
        for i in range(len(flat)):
            for end in range(2):
                v = edges[flat[i], end]
                count[v] = 0
                for k in range(3):
                    total[v, k] = 0.0
        if dropped == 0:
            break
    return 0


def _goes_on(at_rim, count, total, v, cosine):
    """Return whether a line goes on at a vertex, or may end there."""
    away = row(total, v)
    straight = count[v] == 2 and dot(away, away) < 2 - 2 * cosine
    return at_rim[v] or straight or count[v] >= CORNER
