"""A file is checked by the package onnx before any runtime sees it."""

import numpy as np
import onnx
import pytest

from pns_common import ModelError
from pns_common.runtimes.model_check import check_file
from tests.support.networks import (
    CARD,
    VERTEX_CARD,
    perceptron_bytes,
    random_layers,
    vertex_model_bytes,
)

GOOD = perceptron_bytes(random_layers(0))


def refused(change):
    """What a file is refused for, changed so."""
    proto = onnx.load_from_string(GOOD)
    change(proto)
    with pytest.raises(ModelError) as refusal:
        check_file(proto.SerializeToString(), "bad")
    return refusal.value


def test_a_file_that_keeps_the_contract_gives_its_card():
    assert check_file(GOOD, "good") == CARD
    assert check_file(vertex_model_bytes(0), "good") == VERTEX_CARD


def test_what_onnx_itself_finds_invalid_is_refused_in_its_words():
    def read_what_nobody_makes(proto):
        proto.graph.node[0].input[0] = "nothing"

    error = refused(read_what_nobody_makes)
    assert (error.path, error.expected) == ("bad", "a valid ONNX model")
    assert "nothing" in error.found


def test_training_graphs_and_sparse_weights_are_refused():
    assert "training" in refused(lambda proto: proto.training_info.add()).found
    assert "sparse" in refused(lambda proto: proto.graph.sparse_initializer.add()).found


def test_weights_outside_the_file_are_refused_though_they_were_there():
    def elsewhere(proto):
        weight = proto.graph.initializer[0]
        weight.raw_data = np.zeros(3, dtype=np.float32).tobytes()
        weight.external_data.add(key="location", value="weights.bin")

    assert refused(elsewhere).found == "external data"
