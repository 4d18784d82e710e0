"""Corners joined across edges, with the numbers of ``pns_common.connectivity.smooth_fans``."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import INDEX, INDEX_OUT, INTEGERS_2, SIZE, kernel


def _following(h):
    """Return the corner after corner 3 f + i of the same face."""
    return h + 1 if h % 3 < 2 else h - 2


def _join(fans, g, h):
    """Let the least corners that two are known to be joined with be one."""
    while fans[g] != g:
        fans[g] = fans[fans[g]]
        g = fans[g]
    while fans[h] != h:
        fans[h] = fans[fans[h]]
        h = fans[h]
    if g < h:
        fans[h] = g
    else:
        fans[g] = h


@kernel(SIZE, INTEGERS_2, INDEX, INDEX_OUT)
def join_corners(half_edges, rows, fans):
    """Write the fan of each corner (3 F,), numbered as they first appear; returns how many.

    Across each edge that ``rows`` names both ends' corners of its two faces are joined.
    """
    for h in range(fans.shape[0]):
        fans[h] = h
    for r in range(rows.shape[0]):
        there, back = half_edges[rows[r], 0], half_edges[rows[r], 1]
        _join(fans, there, _following(back))
        _join(fans, _following(there), back)
    # Every corner names an earlier one, which has its fan's number by then, or is its fan's first.
    count = 0
    for h in range(fans.shape[0]):
        if fans[h] == h:
            fans[h] = count
            count += 1
        else:
            fans[h] = fans[fans[h]]
    return count
