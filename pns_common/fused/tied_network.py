"""The compiled kernel of tied networks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32

from pns_common.fused.kernels.tied_network import LANES, answer
from pns_common.tied_network.form import TiedForm


def answers_of(
    form: TiedForm, features: Float[np.ndarray, "N K"], budget: float
) -> Float32[np.ndarray, "N 3"]:
    """What ``tied_network.arrays.answers_of`` gives, bit for bit."""
    answers = np.empty((len(features), 3), dtype=np.float32)
    widest = int(form.widths.max())
    units = np.empty((form.copies, widest, LANES), dtype=np.float32)
    held = np.empty((2, max(widest, features.shape[1]), LANES), dtype=np.float32)
    answer(
        features,
        form.pairs,
        form.characters,
        form.widths,
        form.first,
        form.hidden,
        form.biases,
        form.last,
        form.last_characters,
        form.last_bias,
        budget,
        units,
        held,
        answers,
    )
    return answers
