"""The model file's graph, built node by node: the same network always gives the same bytes."""

from typing import Any

import numpy as np
import onnx
from onnx import NodeProto, TensorProto, ValueInfoProto, helper, numpy_helper
from torch import Tensor

from pns_common.model.card import CARD_KEY, ModelCard
from train.models.networks import BoundedNet, SymmetricNet

# New enough for every operator here; runtimes of the last years all read it.
OPSET = 17

# The file format that came with this operator set.
IR_VERSION = 8


def model_bytes(network: BoundedNet, card: ModelCard) -> bytes:
    """Return the model file: features [edges, K] and budget in, corrections [edges, 3] out.

    The projection onto the ball is inside, so ‖correction‖ ≤ budget whatever the weights are.
    Only long-standing standard operators: GELU and SiLU are spelt out.
    """
    graph = Graph()
    make = _symmetric_perceptron if isinstance(network, SymmetricNet) else _perceptron
    _project_onto_ball(graph, make(graph, network, "features"))
    features = rows_info("features", "edges", network.linear_layers[0].in_features)
    budget = helper.make_tensor_value_info("budget", TensorProto.FLOAT, [])
    return serialised(graph, [features, budget], [answers_info("correction", "edges")], card)


class Graph:
    """Nodes and constants in the order of their making; constants are named with the prefix."""

    def __init__(self) -> None:
        self.prefix = ""
        self.nodes: list[NodeProto] = []
        self.constants: list[TensorProto] = []

    def constant(self, name: str, values: np.ndarray | float) -> str:
        """Add a float32 constant under a name of its own, once."""
        return self._keep(name, np.asarray(values, dtype=np.float32))

    def shape(self, name: str, sizes: list[int]) -> str:
        """Add an int64 constant for Reshape, once; −1 stands for what is left."""
        return self._keep(name, np.asarray(sizes, dtype=np.int64))

    def _keep(self, name: str, array: np.ndarray) -> str:
        name = self.prefix + name
        if name not in {tensor.name for tensor in self.constants}:
            self.constants.append(numpy_helper.from_array(array, name))
        return name

    def split(self, value: str, sizes: str, parts: tuple[str, ...]) -> tuple[str, ...]:
        """Add a node that cuts columns in parts, and return their names."""
        self.nodes.append(helper.make_node("Split", [value, sizes], parts, axis=1))
        return parts

    def apply(self, operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        """Add a node and return its output's name."""
        name = output or f"{operator.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name


def _perceptron(graph: Graph, network: BoundedNet, value: str) -> str:
    """Add the layers and return what the last one makes."""
    for index, layer in enumerate(network.linear_layers):
        value = _layer(graph, network, index, value, array(layer.weight), array(layer.bias))
    return value


def _symmetric_perceptron(graph: Graph, network: BoundedNet, features: str) -> str:
    """Add the layers for all G images of the features at once, and return the mean of D_g z(g φ).

    The images are made by the first layer's weights: W (g φ) = W_g φ, columns of W permuted and
    signed. Later layers see G rows for each edge; the last product signs and averages them.
    """
    assert isinstance(network, SymmetricNet)
    group, layers = network.group, network.linear_layers
    count, width = len(group.order), layers[0].out_features
    first = array(layers[0].weight)
    images = np.zeros((count, *first.shape), dtype=np.float32)
    for g in range(count):
        images[g][:, group.order[g]] = first * group.signs[g]
    stacked, bias = images.reshape(count * width, -1), np.tile(array(layers[0].bias), count)
    value = _layer(graph, network, 0, features, stacked, bias)
    value = graph.apply("Reshape", value, graph.shape("row_an_image", [-1, width]))
    for index, layer in enumerate(layers[1:], start=1):
        value = _layer(graph, network, index, value, array(layer.weight), array(layer.bias))
    value = graph.apply("Reshape", value, graph.shape("row_an_edge", [-1, 3 * count]))
    signed_mean = np.concatenate([np.diag(local) for local in group.local]) / count
    return graph.apply("MatMul", value, graph.constant("signed_mean", signed_mean))


def _layer(
    graph: Graph,
    network: BoundedNet,
    index: int,
    value: str,
    weight: np.ndarray,
    bias: np.ndarray,
) -> str:
    """Add a layer, and its activation unless it is the last."""
    weights = graph.constant(f"weight_{index}", weight), graph.constant(f"bias_{index}", bias)
    value = graph.apply("Gemm", value, *weights, transB=1)
    last = index == len(network.linear_layers) - 1
    return value if last else _ACTIVATIONS[network.activation](graph, value)


def array(tensor: Tensor) -> np.ndarray:
    """Return a tensor's values."""
    return tensor.detach().numpy()


def _gelu(graph: Graph, x: str) -> str:
    # The exact one, x/2 (1 + erf(x/√2)).
    # In these operators onnxruntime knows it, and computes it in one of its own.
    root, unit = graph.constant("root_two", np.sqrt(2.0)), graph.constant("one", 1.0)
    half = graph.constant("half", 0.5)
    erf = graph.apply("Erf", graph.apply("Div", x, root))
    return graph.apply("Mul", graph.apply("Mul", x, half), graph.apply("Add", erf, unit))


def silu(graph: Graph, x: str) -> str:
    """Add x σ(x)."""
    return graph.apply("Mul", x, graph.apply("Sigmoid", x))


def _tanh(graph: Graph, x: str) -> str:
    return graph.apply("Tanh", x)


_ACTIVATIONS = {"gelu": _gelu, "silu": silu, "tanh": _tanh}


def _project_onto_ball(graph: Graph, z: str) -> None:
    """Add budget · z / √max(1, ‖z‖²).

    A product with ones puts ‖z‖² into all columns: onnxruntime divides equal shapes several
    times as fast as it spreads one column over three.
    """
    square = graph.apply("Mul", z, z)
    square = graph.apply("MatMul", square, graph.constant("ones", np.ones((3, 3))))
    divisor = graph.apply("Sqrt", graph.apply("Max", square, graph.constant("one", 1.0)))
    graph.apply("Mul", graph.apply("Div", z, divisor), "budget", output="correction")


def rows_info(name: str, rows: str, width: int) -> ValueInfoProto:
    """Describe an input of so many columns."""
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, [rows, width])


def answers_info(name: str, rows: str, columns: int = 3) -> ValueInfoProto:
    """Describe an output of so many columns."""
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, [rows, columns])


def serialised(
    graph: Graph, inputs: list[ValueInfoProto], outputs: list[ValueInfoProto], card: ModelCard
) -> bytes:
    """Return the checked bytes of a model file."""
    model = helper.make_model(
        helper.make_graph(graph.nodes, "pns", inputs, outputs, initializer=graph.constants),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="pns",
    )
    helper.set_model_props(model, {CARD_KEY: card.to_json()})
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)
