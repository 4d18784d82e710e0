"""A tied network in arrays is the dense one, row by row, and stays within its budget."""

import numpy as np

from pns_common.models.tied_form import tied_form
from pns_common.runtimes.tied_network.arrays import ROWS, answers_of
from pns_common.runtimes.tied_network.perceptron import Layer
from tests.support.networks import float64_network, smoothstep
from tests.support.tied import VERTICES, tied_layers

LAYERS = tied_layers(VERTICES, (4, 3))
FORM = tied_form([Layer(*layer) for layer in LAYERS], VERTICES)
FEATURES = np.random.default_rng(0).uniform(-1, 1, (ROWS + 5, 10)).astype(np.float32)


def test_answers_are_the_dense_networks_beyond_a_block_too():
    dense = float64_network([(weight.T, bias) for weight, bias in LAYERS], smoothstep)
    answers = answers_of(FORM, FEATURES.astype(float), 0.25)
    np.testing.assert_allclose(answers, 0.25 * dense(FEATURES.astype(float)), atol=5e-7)


def test_no_answer_is_longer_than_the_budget():
    loud = answers_of(FORM, 100.0 * FEATURES.astype(float), 0.25)
    length = np.linalg.norm(loud.astype(float), axis=1)
    assert length.max() <= 0.25 * (1 + 1e-6)
    assert np.mean(length > 0.2499) > 0.5
