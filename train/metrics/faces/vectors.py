"""Vectors of three numbers, for compiled loops over faces."""

from numba import njit


@njit
def dot(u, v):
    """Return the inner product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@njit
def cross(u, v):
    """Return the cross product."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@njit
def corner_of(corners, face, corner):
    """Return one of a face's three points."""
    return corners[face, corner, 0], corners[face, corner, 1], corners[face, corner, 2]


@njit
def between(p, q):
    """Return the vector from p to q."""
    return q[0] - p[0], q[1] - p[1], q[2] - p[2]
