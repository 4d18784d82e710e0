"""Tied networks by their kernel: the bits of the arrays, whichever layer is the widest."""

import numpy as np
import pytest

from pns_common.fused.kernels.tied_network import LANES
from pns_common.fused.learned.tied_network import answers_of
from pns_common.models.tied_form import Layer, tied_form
from pns_common.runtimes.tied_network import arrays
from tests.support.tied import GROUPS, tied_layers


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize("copies", [(5, 2), (1, 25), (2, 3, 1)])
def test_the_kernel_has_the_arrays_bits(name, copies):
    group = GROUPS[name]
    form = tied_form([Layer(*layer) for layer in tied_layers(group, copies)], group)
    rows = np.random.default_rng(0).uniform(-2, 2, (LANES + 3, group.order.shape[1]))
    made = answers_of(form, rows, 0.7)
    assert made.tobytes() == arrays.answers_of(form, rows, 0.7).tobytes()
    assert made.any()
