"""Vectors of three numbers, for compiled loops over faces."""

from numba import njit

from pns_common.fused.kernels import vectors

cross, dot = njit(vectors.cross), njit(vectors.dot)


@njit
def corner_of(corners, face, corner):
    """Return one of a face's three points."""
    return corners[face, corner, 0], corners[face, corner, 1], corners[face, corner, 2]


@njit
def between(p, q):
    """Return the vector from p to q."""
    return q[0] - p[0], q[1] - p[1], q[2] - p[2]
