"""Tangents at a right angle to normals: the bits of the arrays, whoever makes them."""

import numpy as np
import pytest

from pns_common.base.arrays import unit
from pns_common.base.blocks import Blocks
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import tangents
from pns_common.geometry import tangents as arrays

RNG = np.random.default_rng(0)
# Some axes, some with equal coordinates, one that is none.
NORMALS = np.concatenate([np.eye(3), -np.eye(3), unit(np.ones((2, 3))), unit(RNG.random((80, 3)))])
NORMALS[40] = 0
TANGENTS = RNG.standard_normal((88, 3))
TANGENTS[:20] = np.linspace(-2, 2, 20)[:, None] * NORMALS[:20]
TANGENTS[20:24] = 0


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_tangents_have_the_bits_of_the_arrays(dtype, loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(tangents, "kernels_loaded", lambda: loaded)
    normals = NORMALS.astype(dtype)
    expected = arrays.perpendicular_tangents(TANGENTS, normals, Blocks(1))
    given = np.asfortranarray(TANGENTS), normals, Blocks(threads=2, rows=7)
    made = tangents.perpendicular_tangents(*given)
    assert (made.dtype, made.tobytes()) == (expected.dtype, expected.tobytes())
