"""Model files made in the tests, by a builder of their own: nothing here comes from export."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from pns_common.model.card import CARD_KEY, ModelCard
from pns_common.model.file import model_from_bytes
from pns_common.model.session import networks

PUBLISHED_BUDGET, PUBLISHED_GATE_SHARPNESS = 0.5, 10.0

CARD = ModelCard(1, "paper-5", PUBLISHED_GATE_SHARPNESS, PUBLISHED_BUDGET, "first-face", {}, {})
DEFAULT_CARD = ModelCard(
    *(5, "directed-28", 1e7, 10.0, "symmetric", {}, {}),
    base="loop",
    vertex_gate_sharpness=1e4,
    boundary_strength=1.0,
    network_scale=0.3,
    fold_angle=40.0,
    sharpness_levels=2,
    width=8,
    hidden=12,
    rounds=2,
)
HIDDEN = DEFAULT_CARD.hidden


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


def directed_file(parts, card):
    """A file of format 5: each network reads an input of its own, in the order of `networks`.

    ``parts`` are lists of (weight (in, out), bias) pairs. A weight of fewer rows than its network
    has columns takes the others in place of a bias.
    """
    nodes, weights, held = [], {}, networks(card)
    for each, layers in zip(held, parts, strict=True):
        value = each.given
        for number, (weight, bias) in enumerate(layers):
            name, last = f"{each.given}_{number}", number == len(layers) - 1
            made = each.answer if last else f"{name}_sum"
            weights |= {f"{name}_weight": weight, f"{name}_bias": bias}
            if number == 0 and len(weight) < each.columns:
                weights[f"{name}_bias"] = np.array([len(weight), each.columns - len(weight)])
                cut = [f"{name}_read", f"{name}_added"]
                nodes.append(helper.make_node("Split", [value, f"{name}_bias"], cut, axis=1))
                value, added = cut
            else:
                added = f"{name}_bias"
            nodes.append(helper.make_node("Gemm", [value, f"{name}_weight", added], [made]))
            if not last:
                value = f"{name}_silu"
                nodes.append(helper.make_node("Sigmoid", [made], [f"{name}_gate"]))
                nodes.append(helper.make_node("Mul", [made, f"{name}_gate"], [value]))
    inputs = [(each.given, [f"{each.given}_rows", each.columns]) for each in held]
    outputs = [(each.answer, [f"{each.given}_rows", each.answer_columns]) for each in held]
    return model_bytes(nodes, weights, card=card, inputs=inputs, outputs=outputs, opset=17)


def perceptron(layers, *, project=True):
    """Nodes and weights from the input ``features`` to the output ``correction``."""
    nodes, weights, name = [], {}, "features"

    def add(operator, inputs, output, **attributes):
        nodes.append(helper.make_node(operator, inputs, [output], **attributes))
        return output

    for number, (weight, bias) in enumerate(layers):
        weights |= {f"w{number}": weight, f"b{number}": bias}
        name = add("Gemm", [name, f"w{number}", f"b{number}"], f"z{number}")
        if number < len(layers) - 1:
            name = add("Gelu", [name], f"g{number}")
    if project:
        weights |= {"one": 1.0, "last": np.array([1])}
        add("ReduceL2", [name, "last"], "length", keepdims=1)
        add("Max", ["length", "one"], "divisor")
        name = add("Div", [name, "divisor"], "in_ball")
    add("Mul", [name, "budget"], "correction")
    return nodes, weights


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


def default_model_bytes(seed=0, scale=0.3, **changes):
    """A file of format 5 with random weights, tied by nothing; of scale 0, flat."""
    card = replace(DEFAULT_CARD, **changes)
    parts = []
    for number, each in enumerate(networks(card)):
        last = each.answer == "heads"
        widths = [each.columns, *[HIDDEN] * (not last), each.answer_columns]
        parts.append(random_layers(seed + number, widths, scale))
    return directed_file(parts, card)


def default_model(seed=0, scale=0.3, **changes):
    """A model of format 5 with random weights; of scale 0, flat."""
    return model_from_bytes(default_model_bytes(seed, scale, **changes), "default")


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

    def run(self, given, rows, budget=1.0):
        return budget * self.network(rows)
