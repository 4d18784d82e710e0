"""A tied network in numpy, in single precision: the bits of the compiled kernel.

Every sum is written out in its order, and each row is computed by itself, so a row's bits depend on
nothing else: neither on the other rows, nor on the processor, nor on how many numbers it takes at
once. And a symmetry of the features turns the answer exactly, for it only exchanges units and
changes signs on the way, and no sum is taken in another order.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32

from pns_common.fused.kernels.smoothstep import END, smoothstep_within
from pns_common.models.tied_form import TiedForm

# So many rows at a time stay in the second-level cache.
ROWS = 1024


def answers_of(
    form: TiedForm, features: Float[np.ndarray, "N K"], budget: float
) -> Float32[np.ndarray, "N 3"]:
    """Return the network's answers to rows of features.

    An answer that is not finite is for the caller.
    """
    answers = np.empty((len(features), 3), dtype=np.float32)
    with np.errstate(all="ignore"):
        for start in range(0, len(features), ROWS):
            rows = slice(start, start + ROWS)
            answers[rows] = _in_ball(_z(form, features[rows]), budget)
    return answers


def _z(form: TiedForm, features: Float[np.ndarray, "N K"]) -> Float32[np.ndarray, "3 N"]:
    """Return what the last layer says, before it is projected onto the ball."""
    seen = np.ascontiguousarray(features.T[form.order], dtype=np.float32)
    for i, j in form.pairs:
        seen[i], seen[j] = seen[i] + seen[j], seen[i] - seen[j]
    size, rows = form.copies, seen.shape[1]
    begin, bias_begin = 0, form.widths[0]
    units = _biased(form.biases[:bias_begin], size, rows)
    for k, character in enumerate(form.characters):
        units[character] += form.first[:, k, None] * seen[k]
    for before, width in zip(form.widths, form.widths[1:], strict=False):
        said = _transformed(smoothstep(_transformed(units)))
        units = _biased(form.biases[bias_begin : bias_begin + width], size, rows)
        blocks = form.hidden[begin : begin + size * width * before].reshape(size, width, before)
        for j in range(before):
            units += blocks[:, :, j, None] * said[:, None, j]
        begin, bias_begin = begin + blocks.size, bias_begin + width
    said = _transformed(smoothstep(_transformed(units)))
    z = np.repeat(form.last_bias[:, None], rows, axis=1)
    for i in range(form.widths[-1]):
        z += form.last[:, i, None] * said[form.last_characters, i]
    return z


def _biased(bias: Float32[np.ndarray, " m"], size: int, rows: int) -> Float32[np.ndarray, "G m N"]:
    """Return units by their characters, before any product: a bias is the same for all g."""
    units = np.zeros((size, len(bias), rows), dtype=np.float32)
    units[0] = bias[:, None]
    return units


def _transformed(units: Float32[np.ndarray, "G m N"]) -> Float32[np.ndarray, "G m N"]:
    """Return Σ_g χ_s(g) x_g for all s, as sums and differences; the same leads back, but for n."""
    step = 1
    while step < len(units):
        halves = units.reshape(-1, 2, step, *units.shape[1:])
        even, odd = halves[:, 0], halves[:, 1]
        units = np.stack([even + odd, even - odd], axis=1).reshape(units.shape)
        step *= 2
    return units


def smoothstep(x: Float32[np.ndarray, "G m N"]) -> Float32[np.ndarray, "G m N"]:
    """Return x S(x)."""
    return smoothstep_within(x, np.clip(x, -END, END))


def _in_ball(z: Float32[np.ndarray, "3 N"], budget: float) -> Float32[np.ndarray, "N 3"]:
    """Return budget · z / max(1, ‖z‖), in double precision: no square of a single overflows."""
    x, y, w = wide = z.astype(np.float64)
    length = np.sqrt(x * x + y * y + w * w)
    return (wide / np.where(length > 1, length, 1.0) * budget).astype(np.float32).T
