"""The model file's graph, built node by node: the same network always gives the same bytes."""

import numpy as np
import onnx
from onnx import NodeProto, TensorProto, helper, numpy_helper

from pns_common.model_card import CARD_KEY, ModelCard
from train.networks import BoundedNet

OPSET = 17
"""New enough for every operator here; runtimes of the last years all read it."""

IR_VERSION = 8
"""The file format that came with this operator set."""


def model_bytes(network: BoundedNet, card: ModelCard) -> bytes:
    """Return the model file: features [edges, K] and budget in, corrections [edges, 3] out.

    The projection onto the ball is inside, so ‖correction‖ ≤ budget whatever the weights are.
    Only long-standing standard operators: the exact GELU is x/2 (1 + erf(x/√2)), spelt out.
    """
    graph = _Graph()
    value = "features"
    layers = network.linear_layers
    for index, layer in enumerate(layers):
        weight = graph.constant(f"weight_{index}", layer.weight.detach().numpy())
        bias = graph.constant(f"bias_{index}", layer.bias.detach().numpy())
        value = graph.apply("Gemm", value, weight, bias, transB=1)
        if index < len(layers) - 1:
            value = _ACTIVATIONS[network.activation](graph, value)
    _project_onto_ball(graph, value)
    return _serialise(graph, layers[0].in_features, card)


class _Graph:
    """Nodes and constants in the order of their making."""

    def __init__(self) -> None:
        self.nodes: list[NodeProto] = []
        self.constants: list[TensorProto] = []

    def constant(self, name: str, values: np.ndarray | float) -> str:
        """Add a float32 constant under a name of its own, once."""
        if name not in {tensor.name for tensor in self.constants}:
            array = np.asarray(values, dtype=np.float32)
            self.constants.append(numpy_helper.from_array(array, name))
        return name

    def apply(self, operator: str, *inputs: str, output: str = "", **attributes: object) -> str:
        """Add a node and return its output's name."""
        name = output or f"{operator.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name


def _gelu(graph: _Graph, x: str) -> str:
    root_half = graph.constant("root_half", np.sqrt(0.5))
    one, half = graph.constant("one", 1.0), graph.constant("half", 0.5)
    erf = graph.apply("Erf", graph.apply("Mul", x, root_half))
    return graph.apply("Mul", graph.apply("Mul", x, half), graph.apply("Add", erf, one))


def _tanh(graph: _Graph, x: str) -> str:
    return graph.apply("Tanh", x)


_ACTIVATIONS = {"gelu": _gelu, "tanh": _tanh}


def _project_onto_ball(graph: _Graph, z: str) -> None:
    """Add budget · z / max(1, ‖z‖)."""
    length = graph.apply("ReduceL2", z, axes=[1], keepdims=1)
    divisor = graph.apply("Max", length, graph.constant("one", 1.0))
    graph.apply("Mul", graph.apply("Div", z, divisor), "budget", output="correction")


def _serialise(graph: _Graph, feature_count: int, card: ModelCard) -> bytes:
    inputs = [
        helper.make_tensor_value_info("features", TensorProto.FLOAT, ["edges", feature_count]),
        helper.make_tensor_value_info("budget", TensorProto.FLOAT, []),
    ]
    outputs = [helper.make_tensor_value_info("correction", TensorProto.FLOAT, ["edges", 3])]
    model = helper.make_model(
        helper.make_graph(graph.nodes, "pns", inputs, outputs, initializer=graph.constants),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="pns",
    )
    helper.set_model_props(model, {CARD_KEY: card.to_json()})
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)
