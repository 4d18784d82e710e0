"""What a model file must be, checked before anything of it runs.

Contract: input ``features`` float32 [edges, K], input ``budget`` float32 scalar, output
``correction`` float32 [edges, 3]; standard operators from an allow-list; no external data; the
model card under the metadata key ``pns_card``. Where the card (format 2) names vertex features,
also an input ``vertex_features`` float32 [vertices, L] and an output ``vertex_correction`` float32
[vertices, 3]. One call may hold so much and no more (model_shapes.py).
"""

from __future__ import annotations

from typing import Any

import msgspec
import onnx
from google.protobuf.message import DecodeError

from pns_common.errors import ModelError
from pns_common.features import FEATURE_COUNT
from pns_common.model_card import CARD_KEY, FORMATS, ModelCard
from pns_common.model_shapes import Signature, check_calls, signature
from pns_common.ring_features import RING_FEATURE_SETS

# Arithmetic and the shape bookkeeping around it: no control flow, no random numbers.
# fmt: off
ALLOWED_OPERATORS = frozenset({
    "Abs", "Add", "Cast", "Clip", "Concat", "Constant", "Cos", "Div", "Elu", "Erf", "Exp",
    "Gather", "Gelu", "Gemm", "Greater", "Identity", "LeakyRelu", "Less", "Log", "MatMul",
    "Max", "Min", "Mul", "Neg", "Pow", "Reciprocal", "ReduceL2", "ReduceMax", "ReduceMean",
    "ReduceSum", "ReduceSumSquare", "Relu", "Reshape", "Selu", "Sigmoid", "Sin", "Slice",
    "Softplus", "Split", "Sqrt", "Squeeze", "Sub", "Sum", "Tanh", "Transpose", "Unsqueeze",
    "Where",
})
# fmt: on


def check_file(data: bytes, name: str) -> ModelCard:
    """The card of a file that keeps the contract; ``name`` is what errors call it.

    Raises:
        ModelError: the file breaks the contract; says which part.
    """
    proto = _parse(data, name)
    _check_operators(proto, name)
    _check_valid(proto, name)
    card = _read_card(proto, name)
    _check_interface(proto.graph, card, name)
    answers = [(given, answer_to(given)) for given, _ in feature_inputs(card)]
    check_calls(proto, answers, name)
    return card


def _parse(data: bytes, name: str) -> onnx.ModelProto:
    try:
        return onnx.load_from_string(data)
    except DecodeError as error:
        raise ModelError(name, expected="an ONNX file", found="other bytes") from error


def _check_valid(proto: onnx.ModelProto, name: str) -> None:
    checker: Any = onnx.checker
    try:
        checker.check_model(proto)
    except (ValueError, onnx.checker.ValidationError) as error:
        found = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelError(name, expected="a valid ONNX model", found=found) from error


def _read_card(proto: onnx.ModelProto, name: str) -> ModelCard:
    texts = [entry.value for entry in proto.metadata_props if entry.key == CARD_KEY]
    if len(texts) != 1:
        raise ModelError(name, expected=f"one metadata entry {CARD_KEY}", found=str(len(texts)))
    try:
        return ModelCard.from_json(texts[0])
    except (ValueError, msgspec.MsgspecError) as error:
        raise ModelError(
            name, expected=f"a model card of format {_or(FORMATS)}", found=str(error)
        ) from error


def _check_operators(proto: onnx.ModelProto, name: str) -> None:
    if proto.functions or proto.training_info:
        raise ModelError(name, expected="one graph", found="functions or training graphs beside it")
    graph = proto.graph
    if graph.sparse_initializer:
        raise ModelError(name, expected="dense weights", found="a sparse initializer")
    tensors = list(graph.initializer)
    for node in graph.node:
        if node.domain not in ("", "ai.onnx") or node.op_type not in ALLOWED_OPERATORS:
            operator = f"{node.domain}.{node.op_type}" if node.domain else node.op_type
            raise ModelError(name, expected="operators from the allow-list", found=operator)
        for attribute in node.attribute:
            if attribute.HasField("g") or attribute.graphs:
                raise ModelError(name, expected="one graph", found=f"a graph in {node.op_type}")
            if attribute.HasField("sparse_tensor") or attribute.sparse_tensors:
                raise ModelError(name, expected="dense weights", found="a sparse tensor")
            tensors += [attribute.t, *attribute.tensors]
    for tensor in tensors:
        if tensor.data_location == onnx.TensorProto.EXTERNAL or tensor.external_data:
            raise ModelError(name, expected="all weights inside the file", found="external data")


def _check_interface(graph: onnx.GraphProto, card: ModelCard, name: str) -> None:
    weights = {tensor.name for tensor in graph.initializer}
    inputs = [signature(value) for value in graph.input if value.name not in weights]
    outputs = [signature(value) for value in graph.output]
    widths = feature_inputs(card)
    wanted_in: list[Signature] = [(what, "FLOAT", ["*", width]) for what, width in widths]
    wanted_in.append(("budget", "FLOAT", []))
    wanted_out: list[Signature] = [(answer_to(what), "FLOAT", ["*", 3]) for what, _ in widths]
    for what, wanted, found in [("inputs", wanted_in, inputs), ("outputs", wanted_out, outputs)]:
        if sorted(wanted, key=str) != sorted(found, key=str):
            raise ModelError(name, expected=f"{what} {wanted}", found=f"{found}")


def feature_inputs(card: ModelCard) -> list[tuple[str, int]]:
    """The inputs that are features, and how many columns each has."""
    widths = [("features", FEATURE_COUNT[card.features])]
    if card.vertex_features is not None:
        widths.append(("vertex_features", RING_FEATURE_SETS[card.vertex_features].count))
    return widths


def answer_to(given: str) -> str:
    """The output that an input of features is read for."""
    return given.replace("features", "correction")


def _or(values: tuple[int, ...]) -> str:
    return " or ".join(str(value) for value in values)
