"""Which rows of a file have one normal at one vertex."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import dot, norm, unit

# Exporters compute the two sides of a UV seam apart and round differently: in real files up to
# about 0.01°. Normals within 0.1° are one; an edge that is meant to be hard has degrees.
SAME_NORMAL = np.radians(0.1)
# The label of a row without a normal.
NO_NORMAL = -1
# A direction in which different normals hardly ever have equal coordinates.
SCAN = np.array([1.0, np.sqrt(2), np.sqrt(3)])


def joined_normals(
    vertex: Int[np.ndarray, " N"], normals: Float[np.ndarray, "N 3"]
) -> Int[np.ndarray, " N"]:
    """Return labels that rows share where they have the same vertex and, nearly, the same normal.

    Their directions count, whatever their lengths; to have none is one of its own. Neighbours along
    one line are compared: rows with equal normals are always joined, rows that nearly agree all but
    always, at the cost of one sort however many meet at a vertex.
    """
    # Where a vertex has one row there is nothing to compare: most are inside smooth surfaces.
    several = np.flatnonzero((np.bincount(vertex) > 1)[vertex])
    v, n = vertex[several], unit(normals[several].astype(np.float64))
    # Not by matrix product, whose bits depend on where a row stands.
    order = np.lexsort((*n.T, dot(n, SCAN[None]), v))
    v, n = v[order], n[order]
    opens = np.ones(len(order), dtype=bool)
    opens[1:] = (v[1:] != v[:-1]) | (norm(n[1:] - n[:-1]) > SAME_NORMAL)
    labels = vertex.copy()
    labels[several[order]] = vertex.max(initial=-1) + np.cumsum(opens)
    return labels
