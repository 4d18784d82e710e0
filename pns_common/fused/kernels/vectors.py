"""Vectors of three numbers, with the bits of ``pns_common.base.arrays``."""

from __future__ import annotations

import math


def row(values, i):
    """Return the first three columns of a row."""
    return values[i, 0], values[i, 1], values[i, 2]


def difference(v, u):
    """Return v − u."""
    return v[0] - u[0], v[1] - u[1], v[2] - u[2]


def between(points, a, b):
    """Return the vector from row a to row b."""
    return difference(row(points, b), row(points, a))


def dot(u, v):
    """Return the inner product, summed in the order of ``arrays.dot``."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u, v):
    """Return the cross product, as ``arrays.cross`` has it."""
    return (
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    )


def norm(v):
    """Return the length of a vector, 0 for zero vectors and NaN, as in ``arrays.norm``."""
    square = dot(v, v)
    return math.sqrt(square) if square > 0 else 0.0


def divisor(v):
    """Return the length that makes a unit vector of v; infinite where it has none."""
    square = dot(v, v)
    return math.sqrt(square) if square > 0 else math.inf
