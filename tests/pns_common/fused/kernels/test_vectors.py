"""Vectors, against numpy's."""

import math

import numpy as np

from pns_common.fused.kernels.vectors import between, cross, difference, divisor, dot, norm, row

POINTS = np.array([[1.0, 0, 0], [0, 3, -4], [0, 0, 1]])
ZERO = (0.0, 0.0, 0.0)


def test_vectors():
    u, v = (1.0, 2.0, 2.0), (0.0, 3.0, -4.0)
    assert (dot(u, v), norm(u), norm(ZERO)) == (-2, 3, 0)
    assert cross(u, v) == tuple(np.cross(u, v))
    assert difference(u, v) == (1, -1, 6)
    assert between(POINTS, 0, 2) == (-1, 0, 1)
    assert row(POINTS, 1) == v


def test_what_has_no_length_is_divided_by_what_leaves_nothing():
    assert (divisor((0.0, 3.0, -4.0)), divisor(ZERO), divisor((math.nan, 0.0, 0.0))) == (
        5,
        math.inf,
        math.inf,
    )
