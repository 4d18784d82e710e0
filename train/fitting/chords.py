"""Squared lengths of chords between the rows of a table, with their gradient, in one pass each."""

from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from numba import njit
from torch import Tensor


def squared_chords(
    values: Float[Tensor, "N 3"], ends: Int[np.ndarray, "E 2"]
) -> Float[Tensor, " E"]:
    """Return |v₁ − v₀|² for each pair of rows, with the bits that torch's own operations have."""
    return _SquaredChords.apply(values, ends)


class _SquaredChords(torch.autograd.Function):
    """Torch gathers, subtracts, squares and sums one after the other, and takes longer."""

    @staticmethod
    def forward(ctx: Any, values: Tensor, ends: Int[np.ndarray, "E 2"]) -> Tensor:
        rows = np.ascontiguousarray(values.detach().numpy())
        ctx.rows, ctx.ends = rows, ends
        return torch.from_numpy(_lengths(rows, ends))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        back = _gradient(ctx.rows, ctx.ends, np.ascontiguousarray(gradient.numpy()))
        return torch.from_numpy(back), None


@njit(cache=True)
def _lengths(rows, ends):
    square = np.empty(len(ends))
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        x, y, z = rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1], rows[b, 2] - rows[a, 2]
        square[e] = x * x + y * y + z * z
    return square


@njit(cache=True)
def _gradient(rows, ends, gradient):
    # What first and second ends get is summed apart, as torch does.
    first, second = np.zeros(rows.shape), np.zeros(rows.shape)
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        for k in range(3):
            change = gradient[e] * (2 * (rows[b, k] - rows[a, k]))
            second[b, k] += change
            first[a, k] -= change
    return first + second
