"""Model files made node by node, by a builder of their own: nothing here comes from export."""

import math
from itertools import pairwise

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from pns_common.model.card import CARD_KEY, EDGE_FEATURES, VERTEX_FEATURES, ModelCard
from pns_common.model.file import model_from_bytes

PAPER_CARD = ModelCard(1, "paper-5", 10.0, 0.5, "first-face", {}, {})
DEFAULT_CARD = ModelCard(
    *(4, "signed-18", 1e6, 20.0, "symmetric", {}, {}),
    base="loop",
    vertex_features="ring-10",
    vertex_gate_sharpness=1e3,
    prior_strength=1.0,
    boundary_strength=1.0,
    network_scale=0.4,
    fold_angle=75.0,
    sharpness_levels=2,
)


def model_bytes(
    nodes, weights, *, card=PAPER_CARD, width=5, inputs=None, outputs=None, domains=(), opset=20
):
    """An ONNX file with the given nodes; ``weights`` maps names to arrays."""
    inputs = inputs or [("features", ["edges", width]), ("budget", [])]
    outputs = outputs or [("correction", ["edges", 3])]
    graph = helper.make_graph(
        nodes,
        "test",
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in inputs],
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in outputs],
        [numpy_helper.from_array(_tensor(w), n) for n, w in weights.items()],
    )
    opsets = [helper.make_opsetid("", opset), *(helper.make_opsetid(d, 1) for d in domains)]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=10)
    if card is not None:
        entry = model.metadata_props.add()
        entry.key, entry.value = CARD_KEY, card if isinstance(card, str) else card.to_json()
    return model.SerializeToString()


def _tensor(values):
    values = np.asarray(values)
    return values if values.dtype.kind == "i" else values.astype(np.float32)


def random_layers(seed, widths=(5, 32, 32, 3), scale=1.0):
    """Random weights of a perceptron, (in, out), with biases."""
    rng = np.random.default_rng(seed)
    return [
        (scale * rng.standard_normal((i, o)) / math.sqrt(i), scale * rng.standard_normal(o))
        for i, o in pairwise(widths)
    ]


def perceptron(layers, *, project=True, prefix=""):
    """Nodes and weights of a SiLU perceptron from ``features`` to ``correction``, prefixed."""
    nodes, weights, name = [], {}, "features"

    def add(operator, inputs, output, **attributes):
        names = [each if each == "budget" else prefix + each for each in inputs]
        nodes.append(helper.make_node(operator, names, [prefix + output], **attributes))
        return output

    for number, (weight, bias) in enumerate(layers):
        weights |= {f"weight{number}": weight, f"bias{number}": bias}
        name = add("Gemm", [name, f"weight{number}", f"bias{number}"], f"sum{number}")
        if number < len(layers) - 1:
            gate = add("Sigmoid", [name], f"gate{number}")
            name = add("Mul", [name, gate], f"silu{number}")
    if project:
        weights |= {"last": np.array([1]), "one": 1.0}
        add("ReduceL2", [name, "last"], "length", keepdims=1)
        add("Max", ["length", "one"], "divisor")
        name = add("Div", [name, "divisor"], "in_ball")
    add("Mul", [name, "budget"], "correction")
    return nodes, {f"{prefix}{key}": value for key, value in weights.items()}


def paper_bytes(seed=0, *, scale=1.0, project=True, card=PAPER_CARD):
    """A file of format 1 with random weights."""
    layers = random_layers(seed, scale=scale)
    nodes, weights = perceptron(layers, project=project)
    return model_bytes(nodes, weights, card=card)


def default_bytes(seed=0, *, scale=2.0, card=DEFAULT_CARD):
    """A file of format 4 with random weights, loud enough to use much of its bound."""
    columns = EDGE_FEATURES["signed-18"], VERTEX_FEATURES["ring-10"]
    edges, vertices = (
        random_layers(seed + number, (count, 16, 3), scale) for number, count in enumerate(columns)
    )
    nodes, weights = perceptron(edges)
    more_nodes, more_weights = perceptron(vertices, prefix="vertex_")
    return model_bytes(
        nodes + more_nodes,
        weights | more_weights,
        card=card,
        inputs=[
            ("features", ["edges", columns[0]]),
            ("budget", []),
            ("vertex_features", ["vertices", columns[1]]),
        ],
        outputs=[("correction", ["edges", 3]), ("vertex_correction", ["vertices", 3])],
    )


def paper_model(seed=0, **options):
    """A model of format 1 with random weights."""
    return model_from_bytes(paper_bytes(seed, **options), "random")


def default_model(seed=0, **options):
    """A model of format 4 with random weights."""
    return model_from_bytes(default_bytes(seed, **options), "random")


def float64_perceptron(layers):
    """A SiLU perceptron in float64, projected onto the unit ball."""

    def network(features):
        z = np.asarray(features, dtype=float)
        for number, (weight, bias) in enumerate(layers):
            z = z @ np.asarray(weight, dtype=float) + bias
            if number < len(layers) - 1:
                z = z / (1 + np.exp(-z))
        return z / np.maximum(1, np.linalg.norm(z, axis=1, keepdims=True))

    return network
