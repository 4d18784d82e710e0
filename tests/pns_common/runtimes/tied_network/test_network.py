"""A tied network answers by what is at hand, and is opened from no other file."""

import numpy as np
import pytest

from pns_common.fused import load_kernels
from pns_common.runtimes.onnx_model import model_from_bytes
from pns_common.runtimes.tied_network import network
from pns_common.runtimes.tied_network.arrays import answers_of
from pns_common.runtimes.tied_network.network import LARGEST_FILE, open_tied_network
from tests.support.networks import SCALE_FREE_CARD, model_bytes
from tests.support.tied import EDGES, VERTICES, spelt_perceptron, tied_bytes, tied_layers

BYTES = tied_bytes(tied_layers(EDGES, (3,)), tied_layers(VERTICES, (4,), 1))
CARD, NETWORK = open_tied_network(BYTES, "tied")


def test_each_input_has_its_network_and_rows_of_its_length():
    assert CARD == SCALE_FREE_CARD
    assert sorted(NETWORK.forms) == ["features", "vertex_features"]
    for given, width in (("features", 18), ("vertex_features", 10)):
        assert NETWORK.answers(given, np.zeros((2, width)), 1.0).shape == (2, 3)
        with pytest.raises(ValueError, match=f"{given} of shape"):
            NETWORK.answers(given, np.zeros((2, width + 1)), 1.0)


@pytest.mark.parametrize("loaded", [False, True])
def test_kernels_answer_where_they_are_loaded_and_arrays_until_then(loaded, monkeypatch):
    assert load_kernels()
    asked = []
    monkeypatch.setattr(network, "kernels_loaded", lambda: loaded)
    monkeypatch.setattr(network, "answers_of", lambda *given: asked.append(1) or answers_of(*given))
    rows = np.random.default_rng(0).uniform(-1, 1, (7, 18))
    made = NETWORK.answers("features", rows, 0.5)
    np.testing.assert_array_equal(made, answers_of(NETWORK.forms["features"], rows, 0.5))
    assert asked == ([] if loaded else [1])


def test_a_linear_network_is_opened_by_what_is_installed():
    """One layer, and nothing hidden to be tied."""
    nodes, weights = spelt_perceptron([(np.eye(3, 5), np.zeros(3))])
    data = model_bytes(nodes, weights, opset=17)
    assert open_tied_network(data, "linear") is None
    rows = np.full((1, 5), 0.25)
    assert model_from_bytes(data, "linear")(rows, 1.0).tolist() == [[0.25, 0.25, 0.25]]


def test_a_large_file_is_not_read_for_nothing(monkeypatch):
    monkeypatch.setattr(network, "open_network", None)  # cannot be called
    assert open_tied_network(bytes(LARGEST_FILE + 1), "large") is None
