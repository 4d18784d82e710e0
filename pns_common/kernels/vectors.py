"""Vectors of three numbers, as tuples."""

from __future__ import annotations

import math

from pns_common.kernels import inlined

# Twice the area of a triangle is above this times the sum of two squared sides, or counts as 0.
NO_AREA = 1e-12


@inlined
def row(values, i):
    """Return the first three columns of a row."""
    return values[i, 0], values[i, 1], values[i, 2]


@inlined
def difference(v, u):
    """Return v − u."""
    return v[0] - u[0], v[1] - u[1], v[2] - u[2]


@inlined
def between(points, a, b):
    """Return the vector from row a to row b."""
    return difference(row(points, b), row(points, a))


@inlined
def dot(u, v):
    """Return the inner product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@inlined
def cross(u, v):
    """Return the cross product."""
    return (
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    )


@inlined
def root(square):
    """Return the square root; 0 for 0, negative numbers and NaN."""
    return math.sqrt(square) if square > 0 else 0.0


@inlined
def norm(v):
    """Return the length; 0 for zero vectors and NaN."""
    return root(dot(v, v))


@inlined
def divisor(v):
    """Return the length that makes v a unit vector; infinite where v has no direction."""
    square = dot(v, v)
    return math.sqrt(square) if square > 0 else math.inf


@inlined
def over(v, size):
    """Return v / size."""
    return v[0] / size, v[1] / size, v[2] / size


@inlined
def across(v, along):
    """Return the part of v at right angles to the unit vector ``along``."""
    size = dot(v, along)
    return v[0] - size * along[0], v[1] - size * along[1], v[2] - size * along[2]


@inlined
def area_vector(p, q, r):
    """Return twice the area vector of the triangle p q r."""
    return cross(difference(q, p), difference(r, p))


@inlined
def normal_and_area(p, q, r):
    """Return unit normal (0 without area), twice the area vector, and the length of that."""
    u, v = difference(q, p), difference(r, p)
    vector = cross(u, v)
    square, length = dot(vector, vector), norm(vector)
    shortest = NO_AREA * (dot(u, u) + dot(v, v))
    if square > shortest * shortest:
        return (vector[0] / length, vector[1] / length, vector[2] / length), vector, length
    return (0.0, 0.0, 0.0), vector, length
