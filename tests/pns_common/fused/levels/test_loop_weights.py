"""Weights by valence are the formulas', whatever the largest valence."""

import numpy as np
import pytest

from pns_common.formula.tips import ring_further
from pns_common.fused.levels.loop_weights import KEPT, weights_of
from pns_common.masks.stencils import loop_beta, loop_ring_weight


@pytest.mark.parametrize("largest", [0, 6, KEPT - 1, KEPT, 1000])
def test_each_valence_that_occurs_has_the_weights_of_the_formulas(largest):
    valence = np.array([largest, 0, largest // 2], dtype=np.int32)
    weights = weights_of(valence)
    for table, formula in (
        (weights.beta, loop_beta),
        (weights.ring, loop_ring_weight),
        (weights.further, ring_further),
    ):
        np.testing.assert_array_equal(table[valence], formula(valence.astype(np.int64)))


def test_a_mesh_without_vertices_has_weights_too():
    assert len(weights_of(np.zeros(0, dtype=np.int32)).beta) > 0
