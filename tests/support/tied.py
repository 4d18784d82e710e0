"""Tied networks and their files, by a builder of their own: nothing here comes from training."""

from itertools import pairwise

import numpy as np
from onnx import helper

from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.ring_features import RING_10
from tests.support.networks import SCALE_FREE_CARD, model_bytes

EDGES, VERTICES = FEATURE_SETS["signed-18"].symmetries, RING_10.symmetries
GROUPS = {
    "edges": EDGES,
    "unsigned edges": FEATURE_SETS["paper-5"].symmetries,
    "vertices": VERTICES,
}


def act(group, g, rows):
    """g φ for rows of features."""
    return np.ascontiguousarray(rows[:, group.order[g]] * group.signs[g])


def tied_layers(group, copies, seed=0, loudness=2.5):
    """Random layers (weight (out, in), bias) in single precision, as train/models/tied.py says."""
    rng = np.random.default_rng(seed)
    size, count = group.order.shape

    def random(*shape, inputs):
        return rng.uniform(-loudness, loudness, shape).astype(np.float32) / np.float32(inputs**0.5)

    matrices = [act(group, g, np.eye(count)).T for g in range(size)]
    own = random(copies[0], count, inputs=count)
    layers = [np.concatenate([own @ m for m in matrices])]
    for before, width in pairwise(copies):
        kernel = random(width, before, size, inputs=size * before)
        blocks = [[kernel[:, :, g ^ h] for h in range(size)] for g in range(size)]
        layers.append(np.block(blocks))
    own = random(3, copies[-1], inputs=size * copies[-1])
    layers.append(np.concatenate([np.diag(local) @ own for local in group.local], axis=1))
    biases = [np.tile(random(width, inputs=1), size) for width in copies]
    unmoved = (group.local == 1).all(axis=0)
    biases.append(random(3, inputs=1) * unmoved)
    return [
        (w.astype(np.float32), b.astype(np.float32)) for w, b in zip(layers, biases, strict=True)
    ]


def spelt_perceptron(layers, prefix=""):
    """Nodes and weights of a perceptron, in the operators that export writes."""
    weights = {
        "minus_two": -2.0,
        "two": 2.0,
        "fall": 1 / 32,
        "slope": 3 / 8,
        "half": 0.5,
        "least": 1.0,
    }
    nodes, value = [], "features"

    def add(operator, inputs, output, **attributes):
        named = [name if name == "budget" else prefix + name for name in inputs]
        nodes.append(helper.make_node(operator, named, [prefix + output], **attributes))
        return output

    for number, (weight, bias) in enumerate(layers):
        weights |= {f"w{number}": weight, f"b{number}": bias}
        value = add("Gemm", [value, f"w{number}", f"b{number}"], f"z{number}", transB=1)
        if number < len(layers) - 1:
            t = add("Clip", [value, "minus_two", "two"], f"t{number}")
            square = add("Mul", [t, t], f"s{number}")
            falling = add("Mul", [square, "fall"], f"q{number}")
            slope = add("Sub", ["slope", falling], f"p{number}")
            step = add("Add", [add("Mul", [t, slope], f"o{number}"), "half"], f"a{number}")
            value = add("Mul", [value, step], f"g{number}")
    add("ReduceL2", [value], "length", axes=[1], keepdims=1)
    add("Div", [value, add("Max", ["length", "least"], "divisor")], "in_ball")
    add("Mul", ["in_ball", "budget"], "correction")
    return nodes, {prefix + name: array for name, array in weights.items()}


def tied_bytes(edges, vertices):
    """A file of format 3 of two perceptrons."""
    (nodes, weights), (more, others) = (
        spelt_perceptron(edges),
        spelt_perceptron(vertices, "vertex_"),
    )
    return model_bytes(
        nodes + more,
        weights | others,
        card=SCALE_FREE_CARD,
        inputs=[
            ("features", ["edges", EDGES.order.shape[1]]),
            ("budget", []),
            ("vertex_features", ["vertices", VERTICES.order.shape[1]]),
        ],
        outputs=[("correction", ["edges", 3]), ("vertex_correction", ["vertices", 3])],
        opset=17,
    )
