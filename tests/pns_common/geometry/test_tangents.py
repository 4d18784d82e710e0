"""Tangents lie at a right angle to normals, wherever they pointed."""

import numpy as np

from pns_common.base.arrays import unit
from pns_common.base.blocks import Blocks
from pns_common.geometry.tangents import perpendicular_tangents


def test_tangents_along_the_normal_are_replaced_by_a_perpendicular():
    rng = np.random.default_rng(0)
    normals = unit(rng.standard_normal((50, 3)))
    tangents = np.concatenate([2 * normals[:20], 0 * normals[20:30], rng.standard_normal((20, 3))])
    flat = perpendicular_tangents(tangents, normals, Blocks(threads=2, rows=7))
    np.testing.assert_allclose(np.linalg.norm(flat, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose((flat * normals).sum(axis=1), 0, atol=1e-12)
    # A tangent that has a direction keeps its side.
    assert ((flat * tangents).sum(axis=1)[30:] > 0).all()
