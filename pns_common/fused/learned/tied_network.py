"""The compiled kernel of tied networks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32

from pns_common.fused.kernels.tied_network import LANES, answer
from pns_common.models.tied_form import TiedForm

CACHE_LINE = 64


def answers_of(
    form: TiedForm, features: Float[np.ndarray, "N K"], budget: float
) -> Float32[np.ndarray, "N 3"]:
    """Return what ``tied_network.arrays.answers_of`` gives, bit for bit."""
    answers = np.empty((len(features), 3), dtype=np.float32)
    seen, units = max(features.shape[1], 3), form.copies * int(form.widths.max())
    space = _on_cache_lines((seen + 2 * units) * LANES)
    answer(
        features,
        form.order,
        form.pairs,
        form.characters,
        form.widths,
        form.first.reshape(-1),
        form.hidden,
        form.biases,
        form.last.reshape(-1),
        form.last_characters,
        form.last_bias,
        form.copies,
        budget,
        space[: seen * LANES],
        space[seen * LANES : (seen + units) * LANES],
        space[(seen + units) * LANES :],
        answers.reshape(-1),
    )
    return answers


def _on_cache_lines(size: int) -> Float32[np.ndarray, " N"]:
    """Make space that begins with a cache line, so no vector lies on two: a quarter sooner."""
    line = CACHE_LINE // np.dtype(np.float32).itemsize
    space = np.empty(size + line, dtype=np.float32)
    start = -space.ctypes.data % CACHE_LINE // np.dtype(np.float32).itemsize
    return space[start : start + size]
