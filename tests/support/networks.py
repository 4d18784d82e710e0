"""Model files made in the tests, by a builder of their own: nothing here comes from export."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from pns_common.model.card import (
    CARD_KEY,
    EDGE_FEATURES,
    SHARPNESS_FEATURES,
    VERTEX_FEATURES,
    ModelCard,
)
from pns_common.model.features import FACE_8, RING_10, SIGNED_18
from pns_common.model.file import model_from_bytes

PUBLISHED_BUDGET, PUBLISHED_GATE_SHARPNESS = 0.5, 10.0

CARD = ModelCard(1, "paper-5", PUBLISHED_GATE_SHARPNESS, PUBLISHED_BUDGET, "first-face", {}, {})
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


POLYGON_CARD = replace(DEFAULT_CARD, base="catmull-clark", face_features="face-8")


def model_bytes(
    nodes, weights, *, card=CARD, width=5, inputs=None, outputs=None, domains=(), opset=20
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


def perceptron_bytes(layers, *, project=True, card=CARD):
    """A GELU perceptron from (weight (in, out), bias) pairs, projected onto the ball or not."""
    nodes, weights = perceptron(layers, project=project)
    return model_bytes(nodes, weights, card=card, width=len(layers[0][0]))


def two_perceptrons_bytes(edges, vertices, sharpness=None, *, card=DEFAULT_CARD):
    """A file of format 4: one perceptron for edges, one for old vertices, one for sharpness."""
    nodes, weights = perceptron(edges)
    more_nodes, more_weights = perceptron(vertices, prefix="vertex_")
    inputs = [
        ("features", ["edges", len(edges[0][0])]),
        ("budget", []),
        ("vertex_features", ["vertices", len(vertices[0][0])]),
    ]
    outputs = [("correction", ["edges", 3]), ("vertex_correction", ["vertices", 3])]
    nodes, weights = nodes + more_nodes, weights | more_weights
    if sharpness is not None:
        more_nodes, more_weights = perceptron(sharpness, prefix="sharpness_", answer="sigmoid")
        nodes += [*more_nodes, helper.make_node("Identity", ["sharpness_answer"], ["sharpness"])]
        weights |= more_weights
        inputs.append(("sharpness_features", ["sharpened", len(sharpness[0][0])]))
        outputs.append(("sharpness", ["sharpened", 1]))
    return model_bytes(nodes, weights, card=card, inputs=inputs, outputs=outputs)


def polygon_model(seed=0, scale=2.0, **changes):
    """A model over Catmull–Clark with random weights; of scale 0, the prior alone."""
    asked = {"features": 18, "vertex_features": 10, "face_features": 8}
    nodes, weights, inputs, outputs = [], {}, [("budget", [])], []
    for number, (given, width) in enumerate(asked.items()):
        prefix, answers = given.removesuffix("features"), 1 if given == "face_features" else 3
        layers = random_layers(seed + number, (width, 16, answers), scale)
        more_nodes, more_weights = perceptron(layers, prefix=prefix)
        nodes, weights = nodes + more_nodes, weights | more_weights
        inputs.append((given, [f"{prefix}rows", width]))
        outputs.append((f"{prefix}correction", [f"{prefix}rows", answers]))
    card = replace(POLYGON_CARD, **changes)
    data = model_bytes(nodes, weights, card=card, inputs=inputs, outputs=outputs)
    return model_from_bytes(data, "polygons")


def perceptron(layers, *, project=True, prefix="", answer="correction"):
    """Nodes and weights from the input ``features`` to the output ``correction``, prefixed.

    With the answer "sigmoid" the output is ``answer``, the sigmoid of the last layer.
    """
    nodes, weights, name = [], {}, "features"

    def add(operator, inputs, output, **attributes):
        inputs = [i if i == "budget" else f"{prefix}{i}" for i in inputs]
        nodes.append(helper.make_node(operator, inputs, [f"{prefix}{output}"], **attributes))
        return output

    for number, (weight, bias) in enumerate(layers):
        weights |= {f"w{number}": weight, f"b{number}": bias}
        name = add("Gemm", [name, f"w{number}", f"b{number}"], f"z{number}")
        if number < len(layers) - 1:
            name = add("Gelu", [name], f"g{number}")
    if answer == "sigmoid":
        add("Sigmoid", [name], "answer")
        return nodes, {f"{prefix}{key}": value for key, value in weights.items()}
    if project:
        weights |= {"one": 1.0, "last": np.array([1])}
        add("ReduceL2", [name, "last"], "length", keepdims=1)
        add("Max", ["length", "one"], "divisor")
        name = add("Div", [name, "divisor"], "in_ball")
    add("Mul", [name, "budget"], "correction")
    return nodes, {f"{prefix}{key}": value for key, value in weights.items()}


def breaking_off_bytes():
    """A file that keeps the contract and reads rows that there are not, whatever it is given."""
    nodes = [
        helper.make_node("Slice", ["features", "zero", "one", "axis"], ["first"]),
        helper.make_node("Slice", ["features", "zero", "three", "axis"], ["answer"]),
        helper.make_node("Squeeze", ["first", "axis"], ["flat"]),
        helper.make_node("Add", ["flat", "far"], ["beyond"]),
        helper.make_node("Cast", ["beyond"], ["rows"], to=TensorProto.INT64),
        helper.make_node("Gather", ["answer", "rows"], ["correction"]),
    ]
    whole = {name: np.array([i]) for name, i in (("zero", 0), ("one", 1), ("three", 3))}
    return model_bytes(nodes, whole | {"axis": whole["one"], "far": np.full(1, 1e6)})


def random_layers(seed, widths=(5, 32, 32, 3), scale=1.0):
    """Random weights of a perceptron."""
    rng = np.random.default_rng(seed)
    return [
        (scale * rng.standard_normal((i, o)) / math.sqrt(i), scale * rng.standard_normal(o))
        for i, o in pairwise(widths)
    ]


def random_model(seed, scale=1.0):
    """A model with random weights."""
    return model_from_bytes(perceptron_bytes(random_layers(seed, scale=scale)), "random")


def default_model_bytes(seed=0, scale=2.0, **changes):
    """A file of format 4 with random weights; of scale 0, the prior alone."""
    edges = random_layers(seed, (EDGE_FEATURES["signed-18"], 16, 3), scale)
    vertices = random_layers(seed + 1, (VERTEX_FEATURES["ring-10"], 16, 3), scale)
    card = replace(DEFAULT_CARD, **changes)
    sharpness = None
    if card.sharpness_features is not None:
        widths = (SHARPNESS_FEATURES[card.sharpness_features], 16, 1)
        sharpness = random_layers(seed + 2, widths, scale)
    return two_perceptrons_bytes(edges, vertices, sharpness, card=card)


def default_model(seed=0, scale=2.0, **changes):
    """A model of format 4 with random weights; of scale 0, the prior alone."""
    return model_from_bytes(default_model_bytes(seed, scale, **changes), "default")


def sharpening_model(seed=0, scale=2.0, **changes):
    """A model of format 4 with random weights, that also says how sharp edges are."""
    return default_model(seed, scale, sharpness_features="crease-53", **changes)


def huge_model(seed):
    """A hostile model: its file lies, its corrections have norms of about 10⁶ budgets."""
    layers = random_layers(seed)
    layers[-1] = (layers[-1][0] * 1e6, layers[-1][1] * 1e6)
    return model_from_bytes(perceptron_bytes(layers, project=False), "huge")


def published_layers(weights, checkpoint):
    """The published state dictionary as (weight (in, out), bias) pairs."""
    keys = sorted(k for k in weights if k.startswith(f"{checkpoint}/") and k.endswith("weight"))
    return [(weights[k].T, weights[k.removesuffix("weight") + "bias"]) for k in keys]


def published_model(weights, checkpoint):
    """A published network as a model file."""
    return model_from_bytes(perceptron_bytes(published_layers(weights, checkpoint)), checkpoint)


def gelu(z):
    """x Φ(x), in double precision."""
    return 0.5 * z * (1 + np.vectorize(math.erf, otypes=[float])(z / math.sqrt(2)))


def float64_network(layers, activation=gelu):
    """A perceptron in float64 numpy, projected onto the unit ball."""

    def network(features):
        z = features
        for number, (weight, bias) in enumerate(layers):
            z = z @ np.asarray(weight, dtype=float) + bias
            if number < len(layers) - 1:
                z = activation(z)
        return z / np.maximum(1, np.linalg.norm(z, axis=1, keepdims=True))

    return network


class Float64Model:
    """A perceptron that keeps the model protocol in double precision."""

    name, hash, card = "float64", "0" * 64, CARD

    def __init__(self, layers):
        self.network = float64_network(layers)

    def __call__(self, features, budget):
        return budget * self.network(features)

    def vertex_correction(self, features, budget):
        raise AssertionError("format 1 has no vertex network")

    def sharpness(self, features):
        raise AssertionError("format 1 has no sharpness network")


class TiedPolygonModel:
    """Networks in double precision with the symmetries of their features, by averaging."""

    name, hash, card = "tied", "0" * 64, POLYGON_CARD

    def __init__(self, seed):
        self.networks = {
            seen.name: (float64_network(random_layers(seed, (seen.count, 16, 3))), seen.symmetries)
            for seen in (SIGNED_18, RING_10, FACE_8)
        }

    def _answers(self, name, features, budget):
        network, group = self.networks[name]
        turned = [
            local * network(signs * features[:, order])
            for order, signs, local in zip(group.order, group.signs, group.local, strict=True)
        ]
        return budget * np.mean(turned, axis=0)

    def __call__(self, features, budget):
        return self._answers("signed-18", features, budget)

    def vertex_correction(self, features, budget):
        return self._answers("ring-10", features, budget)

    def sharpness(self, features):
        raise AssertionError("the card names no sharpness network")

    def face_correction(self, features, budget):
        return self._answers("face-8", features, budget)[:, :1]
