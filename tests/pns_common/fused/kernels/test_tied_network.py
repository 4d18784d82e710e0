"""The parts of the tied networks' kernel, each by itself as plain Python."""

import numpy as np
import pytest

from pns_common.fused.kernels.tied_network import LANES, SEEN, _read, _transform, _write
from pns_common.models.tied_form import character_table

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("size", [2, 4, 8])
def test_sums_and_differences_are_by_characters_and_lead_back(size):
    units = RNG.integers(-9, 9, (size, 3, LANES)).astype(np.float32)
    before = units.copy()
    _transform(units, 2)
    expected = np.einsum("sg,gil->sil", character_table(size), before[:, :2])
    np.testing.assert_array_equal(units[:, :2], expected)
    np.testing.assert_array_equal(units[:, 2], before[:, 2])  # beyond the layer's width
    _transform(units, 2)
    np.testing.assert_array_equal(units[:, :2], size * before[:, :2])


def test_rows_stand_side_by_side_and_nothing_past_the_last():
    features, held = RNG.standard_normal((5, 2)), np.full((2, 2, LANES), 9, dtype=np.float32)
    _read(features, 2, held)
    np.testing.assert_array_equal(held[SEEN, :, :3], features[2:].T.astype(np.float32))
    assert not held[SEEN, :, 3:].any()


def test_an_answer_is_shortened_to_the_budget_also_where_its_square_is_no_single():
    held = np.zeros((2, 3, LANES), dtype=np.float32)
    held[SEEN, :, 0], held[SEEN, :, 1] = [0.3, 0, -0.4], [3e30, 0, 4e30]
    answers = np.full((4, 3), 9, dtype=np.float32)
    _write(held, 2, 0.5, answers)
    np.testing.assert_allclose(answers[2:], [[0.15, 0, -0.2], [0.3, 0, 0.4]], rtol=1e-6)
    assert (answers[:2] == 9).all()
