"""Points of split faces: the bits of the arrays, whoever makes them."""

import numpy as np
import pytest

from pns_common.base.blocks import Blocks
from pns_common.connectivity import grid_points as arrays
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import grid_points

RNG = np.random.default_rng(0)
BLOCKS = Blocks(threads=2, rows=7)
IDS = RNG.permutation(40 * 10).reshape(40, 10)
FACES = RNG.integers(0, 30, (40, 3))
# Negative zeros too: what is blended of them is not negative.
OWNER = RNG.permutation(np.repeat(np.arange(7), [1, 1, 1, 3, 3, 3, 4]))
VALUES = RNG.choice([-0.0, 0.0, 1.0, -1 / 3, 1e-300], (30, 2))

CALLS = {
    "take_points": (IDS, np.array([3, 3, 9, 0]), np.int32),
    "take_points of int32": (IDS.astype(np.int32), np.array([3, 0]), np.int32),
    "take_points of columns": (np.asfortranarray(IDS), np.array([3, 0]), np.int32),
    "take_points in int64": (IDS, np.array([3, 0]), np.int64),
    "number_points": (
        FACES,
        30 + 3 * RNG.integers(0, 90, (40, 3)),
        300,
        OWNER,
        np.where(OWNER < 3, 0, RNG.integers(0, 3, (8, 16))),
    ),
    "move_to_vertices": (IDS.astype(np.int32), (IDS + 7).astype(np.int32), 400),
    "move_to_vertices of int64": (IDS, IDS + 7, 400),
    "rounded_rows": (RNG.standard_normal((30, 3)), FACES.reshape(-1)),
    "rounded_rows of columns": (np.asfortranarray(RNG.standard_normal((30, 3))), FACES[:, 0]),
    "rounded_rows of singles": (RNG.random((30, 3)).astype(np.float32), FACES[:, 0]),
}


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("name", CALLS)
def test_indices_and_rows_are_those_of_the_arrays(name, loaded, monkeypatch):
    choose(loaded, monkeypatch)
    function, given = name.partition(" ")[0], CALLS[name]
    expected = getattr(arrays, function)(*given, Blocks(1))
    made = getattr(grid_points, function)(*given, BLOCKS)
    assert made.dtype == expected.dtype
    np.testing.assert_array_equal(made, expected)


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("points", [0, 1, 3])
@pytest.mark.parametrize("function", ["blend_along", "blend_inside"])
def test_blended_values_have_the_bits_of_the_arrays(function, points, loaded, monkeypatch):
    choose(loaded, monkeypatch)
    if function == "blend_along":
        corners, shares = FACES[:, :2], np.arange(1, points + 1) / (points + 1)
    else:
        corners, shares = FACES, RNG.dirichlet(np.ones(3), points)
    made, expected = np.full((2, 40 * points, 2), np.nan)
    getattr(arrays, function)(VALUES, corners, shares, expected, Blocks(1))
    getattr(grid_points, function)(VALUES, corners, shares, made, BLOCKS)
    assert made.tobytes() == expected.tobytes()


def choose(loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(grid_points, "kernels_loaded", lambda: loaded)
