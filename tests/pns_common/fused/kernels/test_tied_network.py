"""The parts of the tied networks' kernel, each by itself as plain Python."""

import numpy as np
import pytest

from pns_common.fused.kernels.tied_network import (
    LANES,
    _activate,
    _read,
    _transform,
    _weigh,
    _write,
)
from pns_common.models.tied_form import character_table
from pns_common.runtimes.tied_network.arrays import smoothstep

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("size", [2, 4, 8])
def test_sums_and_differences_are_by_characters_and_lead_back(size):
    units = RNG.integers(-9, 9, (3, size, LANES)).astype(np.float32)
    before, numbers = units.copy(), units.reshape(-1)
    _transform(numbers, size, 2)
    expected = np.einsum("sg,igl->isl", character_table(size), before[:2])
    np.testing.assert_array_equal(units[:2], expected)
    np.testing.assert_array_equal(units[2], before[2])  # beyond the layer's width
    _transform(numbers, size, 2)
    np.testing.assert_array_equal(units[:2], size * before[:2])


@pytest.mark.parametrize("size", [2, 4, 8])
def test_what_units_say_is_of_copies_by_characters_again(size):
    # Whole numbers: their sums are exact, in any order.
    units = RNG.integers(-3, 3, (2, size, LANES)).astype(np.float32)
    said, characters = np.zeros_like(units), character_table(size).astype(np.float32)
    copies = np.einsum("sg,igl->isl", characters, units)
    _activate(units.reshape(-1), said.reshape(-1), size, 2)
    expected = np.einsum("sg,igl->isl", character_table(size), smoothstep(copies).astype(float))
    np.testing.assert_allclose(said, expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 6, 7, 8])
def test_products_are_added_to_the_bias_one_after_the_other(count):
    said = RNG.standard_normal((2 * count, LANES)).astype(np.float32)
    weights, made = RNG.standard_normal(count + 1).astype(np.float32), np.zeros((3, LANES), "f4")
    _weigh(made.reshape(-1), 1, np.float32(0.3), said.reshape(-1), 1, 2, count, weights, 1)
    expected = np.full(LANES, 0.3, dtype=np.float32)
    for j in range(count):
        expected += weights[1 + j] * said[1 + 2 * j]
    np.testing.assert_array_equal(made[1], expected)
    assert not made[[0, 2]].any()


def test_rows_stand_side_by_side_and_nothing_past_the_last():
    features, seen = RNG.standard_normal((5, 3)), np.full((3, LANES), 9, dtype=np.float32)
    order = np.array([2, 0, 1], dtype=np.int32)
    _read(features, order, 2, seen.reshape(-1))
    np.testing.assert_array_equal(seen[:, :3], features[2:, order].T.astype(np.float32))
    assert not seen[:, 3:].any()


def test_an_answer_is_shortened_to_the_budget_also_where_its_square_is_no_single():
    z = np.zeros((3, LANES), dtype=np.float32)
    z[:, 0], z[:, 1] = [0.3, 0, -0.4], [3e30, 0, 4e30]
    answers = np.full((4, 3), 9, dtype=np.float32)
    _write(z.reshape(-1), 2, 0.5, answers.reshape(-1))
    np.testing.assert_allclose(answers[2:], [[0.15, 0, -0.2], [0.3, 0, 0.4]], rtol=1e-6)
    assert (answers[:2] == 9).all()
