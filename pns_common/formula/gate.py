"""γ = tanh of what bends: 0 where nothing does, and 1 to the last bit where much does."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import Array, namespace

# The tanh of this and more is 1 in float64: 2 exp(−44) is a hundredth of half its last place.
SATURATED = 22.0


def gate_of(values: Float[Array, " N"]) -> Float[Array, " N"]:
    """Return tanh of values ≥ 0; NaN stays NaN.

    The gates of the default model are wide open at nearly all edges: there nothing is evaluated.
    """
    if type(values) is not np.ndarray:
        return namespace(values).tanh(values)
    is_open = values >= SATURATED
    count = np.count_nonzero(is_open)
    if 2 * count < len(values):
        return np.tanh(values)
    gates = np.ones_like(values)
    if count < len(values):
        asked = ~is_open
        gates[asked] = np.tanh(values[asked])
    return gates
