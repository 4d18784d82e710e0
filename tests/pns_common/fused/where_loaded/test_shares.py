"""Shares of named columns: the bits of the arrays, whoever makes them."""

import numpy as np
import pytest

from pns_common.base.blocks import Blocks
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import shares
from pns_common.masks import shares as arrays

RNG = np.random.default_rng(0)
BLOCKS = Blocks(threads=2, rows=50)
ROWS = 300
# Some are equal, many nothing.
COLUMNS = np.where(
    RNG.random((ROWS, 7)) < 0.3, RNG.choice([0, 0.1, 0.2], (ROWS, 7)), RNG.random((ROWS, 7))
)


def weights_of(width):
    """Make rows of shares of every size; some rows and many slots are empty."""
    made = RNG.random((ROWS, width)) * 10.0 ** RNG.integers(-9, 2, (ROWS, width))
    return np.where(
        RNG.random((ROWS, 1)) < 0.1, 0.0, np.where(RNG.random(made.shape) < 0.2, 0, made)
    )


@pytest.mark.parametrize("names", [np.int32, np.int64])
@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("slots", [1, 4, 8])
def test_the_same_are_kept_and_as_much_is_lost(slots, loaded, names, monkeypatch):
    choose(loaded, monkeypatch)
    kept = []
    for module in (arrays, shares):
        own = np.zeros((ROWS, slots), dtype=names), np.zeros((ROWS, slots)), np.zeros(ROWS)
        for some in ([0, 1, 2], [3, 4], [5, 6]):
            module.keep_heaviest(COLUMNS[:, some], 9 - np.array(some), *own, BLOCKS)
        kept.append(own)
    for expected, made in zip(*[own[:2] for own in kept], strict=True):
        assert made.tobytes() == expected.tobytes()
    np.testing.assert_allclose(kept[1][2], kept[0][2], rtol=1e-14, atol=0)


# Numpy adds up eight numbers in another order than seven, and from sixteen on every eighth.
@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("width", [1, 4, 7, 8, 12, 16, 24, 28, 128, 132])
def test_rows_are_scaled_and_rounded_to_the_same_bits(width, loaded, monkeypatch):
    choose(loaded, monkeypatch)
    weights = weights_of(width)
    for full in (255, 2**24):
        expected = arrays.whole_units(weights, full, Blocks(1))
        for given in (weights, np.asfortranarray(weights)):
            made = shares.whole_units(given, full, BLOCKS)
            assert made.dtype == expected.dtype
            np.testing.assert_array_equal(made, expected)
    scaled, made = weights.copy(), weights.copy()
    arrays.scale_rows(scaled, Blocks(1))
    shares.scale_rows(made, BLOCKS)
    assert made.tobytes() == scaled.tobytes()


def choose(loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(shares, "kernels_loaded", lambda: loaded)
