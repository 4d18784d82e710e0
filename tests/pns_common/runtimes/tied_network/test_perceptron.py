"""A graph as export writes it is read as the perceptron that it is, and no other graph."""

import numpy as np

from pns_common.runtimes.numpy_network import open_network
from pns_common.runtimes.numpy_network.network import NumpyNetwork
from pns_common.runtimes.numpy_network.onnx_schema import Node
from pns_common.runtimes.tied_network.perceptron import read_perceptron
from tests.support.networks import perceptron_bytes, random_layers
from tests.support.tied import EDGES, VERTICES, tied_bytes, tied_layers

OF_EDGES, OF_VERTICES = tied_layers(EDGES, (3, 5)), tied_layers(VERTICES, (4,), 1)
_, GRAPH = open_network(tied_bytes(OF_EDGES, OF_VERTICES), "two")


def test_each_networks_layers_are_read_in_their_order():
    for given, output, expected in (
        ("features", "correction", OF_EDGES),
        ("vertex_features", "vertex_correction", OF_VERTICES),
    ):
        layers = read_perceptron(GRAPH, given, output)
        for layer, (weight, bias) in zip(layers, expected, strict=True):
            np.testing.assert_array_equal(layer.weight, weight)
            np.testing.assert_array_equal(layer.bias, bias)


def test_what_reads_another_input_or_is_spelt_otherwise_is_none():
    assert read_perceptron(GRAPH, "vertex_features", "correction") is None
    _, with_gelu = open_network(perceptron_bytes(random_layers(0)), "other")
    assert read_perceptron(with_gelu, "features", "correction") is None


def test_a_graph_that_ends_anywhere_before_is_none():
    inner = [name for node in GRAPH.leading_to("correction") for name in node.outputs]
    assert inner.pop() == "correction"
    assert len(inner) > 10
    for name in inner:
        assert read_perceptron(GRAPH, "features", name) is None


def test_a_graph_that_goes_on_is_none():
    further = Node("Neg", ("correction",), ("opposite",), {})
    graph = NumpyNetwork([*GRAPH.nodes, further], GRAPH.weights)
    assert read_perceptron(graph, "features", "opposite") is None


def test_weights_that_are_computed_or_of_another_width_are_none():
    first = GRAPH.leading_to("correction")[0]
    for name in first.inputs[1:]:
        others = {key: value for key, value in GRAPH.weights.items() if key != name}
        assert read_perceptron(NumpyNetwork(GRAPH.nodes, others), "features", "correction") is None
    shorter = {**GRAPH.weights, first.inputs[2]: GRAPH.weights[first.inputs[2]][:-1]}
    assert read_perceptron(NumpyNetwork(GRAPH.nodes, shorter), "features", "correction") is None
