"""Sums around the vertices that a thread owns: rows that lie elsewhere are passed by, by the block.

Each thread goes through all edges, or faces, in ascending order. Where a mesh is numbered as it
lies, a block of them is at the vertices of one thread alone, and the others need not look at it.
"""

from __future__ import annotations

from pns_common.fused.kernels.compiled import natural

# Rows of a block.
PASSED_BY = 1024


def block_end(rows, block):
    """Return the row after a block's last."""
    return min(PASSED_BY * (block + 1), rows.shape[0])


def owned_rows(rows, reach, block, begin, end):
    """Return a block's first row and how many there are to look at: none if all are elsewhere."""
    first = natural(PASSED_BY * block)
    return first, 0 if is_elsewhere(reach, block, begin, end) else block_end(rows, block) - first


def is_elsewhere(reach, block, begin, end):
    """Return whether no row of a block has a vertex of begin … end − 1.

    ``reach`` has the smallest and the largest vertex of each block.
    """
    return reach[block, 1] < begin or reach[block, 0] >= end
