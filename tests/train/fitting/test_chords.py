"""Squared chords and their gradient: the bits of torch's own operations."""

import numpy as np
import pytest
import torch

from train.fitting.chords import squared_chords


@pytest.mark.parametrize("order", ["C", "F"])
def test_lengths_and_gradients_have_the_bits_of_torch(order):
    rng = np.random.default_rng(0)
    table = np.asarray(rng.standard_normal((50, 3)), order=order)
    # Many pairs share an end, so that the order of sums shows; some are of one row with itself.
    ends, weights = rng.integers(0, 50, (400, 2)), torch.from_numpy(rng.standard_normal(400))
    ours, theirs = (torch.tensor(table, requires_grad=True) for _ in range(2))
    made = squared_chords(ours, ends)
    expected = ((theirs[ends[:, 1]] - theirs[ends[:, 0]]) ** 2).sum(dim=1)
    assert torch.equal(made, expected)
    (made * weights).sum().backward()
    (expected * weights).sum().backward()
    assert torch.equal(ours.grad, theirs.grad)
