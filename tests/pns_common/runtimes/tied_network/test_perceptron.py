"""A graph as export writes it is read as the perceptron that it is, and no other graph."""

import numpy as np

from pns_common.runtimes.numpy_network import open_network
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
