"""Loop's weights by valence, as kernels look them up."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float, Int

from pns_common.formula.tips import ring_further
from pns_common.masks.stencils import loop_beta, loop_ring_weight

# Of most meshes no vertex has more neighbours: making the tables again takes a tenth of a cube's
# refinement.
KEPT = 64


@dataclass(frozen=True, eq=False)
class LoopWeights:
    """β_k, k β_k and λ_k of valences k = 0, 1, 2, … (masks/stencils.py, formula/tips.py)."""

    beta: Float[np.ndarray, " K"]
    ring: Float[np.ndarray, " K"]
    further: Float[np.ndarray, " K"]


def weights_of(valence: Int[np.ndarray, " V"]) -> LoopWeights:
    """Return the weights of all valences that occur, and perhaps of more."""
    largest = int(valence.max(initial=0))
    return _kept() if largest < KEPT else _weights(largest + 1)


@cache
def _kept() -> LoopWeights:
    return _weights(KEPT)


def _weights(count: int) -> LoopWeights:
    each = np.arange(count)
    return LoopWeights(loop_beta(each), loop_ring_weight(each), ring_further(each))
