"""A session of onnxruntime: of a checked file, one output at a time, its errors as they are."""

import numpy as np
import pytest

from pns_common import ModelError
from pns_common.runtimes.onnx_session import OnnxSession, open_session
from tests.support.networks import CARD, float64_network, perceptron_bytes, random_layers

LAYERS = random_layers(0)
FILE = perceptron_bytes(LAYERS)


def test_a_session_answers_what_the_graph_says():
    card, session = open_session(FILE, "good")
    assert card == CARD
    rows = np.random.default_rng(0).uniform(-2, 2, (7, 5)).astype(np.float32)
    answer = session.run("correction", {"features": rows, "budget": np.array(0.5, np.float32)})
    assert answer.dtype == np.float32
    np.testing.assert_allclose(answer, 0.5 * float64_network(LAYERS)(rows), atol=1e-6)


def test_a_file_is_checked_before_onnxruntime_sees_it():
    with pytest.raises(ModelError, match="ONNX") as refusal:
        open_session(FILE[:-20], "cut")
    assert refusal.value.path == "cut"
    with pytest.raises(ModelError) as refusal:
        OnnxSession(FILE[:-20], "cut")  # without the check
    assert refusal.value.expected == "a graph that onnxruntime runs"


def test_what_is_asked_wrongly_is_onnxruntimes_to_say():
    _, session = open_session(FILE, "good")
    with pytest.raises(Exception, match="budget"):
        session.run("correction", {"features": np.zeros((1, 5), dtype=np.float32)})
