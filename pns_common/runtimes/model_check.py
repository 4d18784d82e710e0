"""What a model file must be, checked by the package onnx before onnxruntime sees it.

The contract is models/contract.py's. This module needs the packages onnx and protobuf and is
imported where they are; numpy_network/ checks the same without them.
"""

from __future__ import annotations

from typing import Any

import onnx
from google.protobuf.message import DecodeError

from pns_common.errors import ModelError
from pns_common.models.card import CARD_KEY, ModelCard
from pns_common.models.contract import (
    ALLOWED_OPERATORS,
    answer_to,
    check_interface,
    feature_inputs,
    read_card,
)
from pns_common.runtimes.call_shapes import check_calls, signature


def check_file(data: bytes, name: str) -> ModelCard:
    """Return the card of a file that keeps the contract; ``name`` is what errors call it.

    Raises:
        ModelError: the file breaks the contract; says which part.
    """
    proto = _parse(data, name)
    _check_operators(proto, name)
    _check_valid(proto, name)
    card = read_card([e.value for e in proto.metadata_props if e.key == CARD_KEY], name)
    weights = {tensor.name for tensor in proto.graph.initializer}
    inputs = [signature(value) for value in proto.graph.input if value.name not in weights]
    check_interface(inputs, [signature(value) for value in proto.graph.output], card, name)
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
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelError(name, expected="a valid ONNX model", found=reason) from error


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
        _check_outputs(node, name)
        for attribute in node.attribute:
            if attribute.HasField("g") or attribute.graphs:
                raise ModelError(name, expected="one graph", found=f"a graph in {node.op_type}")
            if attribute.HasField("sparse_tensor") or attribute.sparse_tensors:
                raise ModelError(name, expected="dense weights", found="a sparse tensor")
            tensors += [attribute.t, *attribute.tensors]
    for tensor in tensors:
        if tensor.data_location == onnx.TensorProto.EXTERNAL or tensor.external_data:
            raise ModelError(name, expected="all weights inside the file", found="external data")


def _check_outputs(node: onnx.NodeProto, name: str) -> None:
    """Refuse a Split into another number of parts than it names outputs: it ends onnxruntime."""
    for attribute in node.attribute:
        if attribute.name == "num_outputs" and attribute.i != len(node.output):
            outputs = f"{node.op_type} with {len(node.output)} outputs, not {attribute.i}"
            raise ModelError(name, expected="shapes that fit together", found=outputs)
