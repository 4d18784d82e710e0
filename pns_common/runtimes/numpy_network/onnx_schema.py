"""The ONNX messages that a model file may hold, and the graph that is made of them.

Field numbers: onnx.proto3 of https://github.com/onnx/onnx. What a model file may not hold (graphs
in nodes, sparse tensors, functions, training graphs) has a name here so that errors can say it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pns_common.runtimes.numpy_network.wire import Field, Message, Schema, read_message

# Numbers of TensorProto.DataType, with what a tensor of them is held in: floats in double
# precision, so that nothing but the answer is rounded to single.
FLOAT, INT32, INT64, BOOL, DOUBLE = 1, 6, 7, 9, 11
RAW_TYPES = {FLOAT: "<f4", INT32: "<i4", INT64: "<i8", BOOL: "?", DOUBLE: "<f8"}
HELD_TYPES = {
    FLOAT: np.float64,
    INT32: np.int64,
    INT64: np.int64,
    BOOL: np.bool_,
    DOUBLE: np.float64,
}
_NUMBERS_OF = {
    FLOAT: "float_data",
    DOUBLE: "double_data",
    INT64: "int64_data",
    INT32: "int32_data",
    BOOL: "int32_data",
}

_ENTRY: Schema = {1: Field("key", "bytes"), 2: Field("value", "bytes")}
_DIM: Schema = {
    1: Field("value", "int"),
    2: Field("name", "bytes"),
    3: Field("denotation", "bytes"),
}
_SHAPE: Schema = {1: Field("dims", _DIM, repeated=True)}
_TENSOR_TYPE: Schema = {1: Field("element", "int"), 2: Field("shape", _SHAPE)}
_TYPE: Schema = {1: Field("tensor", _TENSOR_TYPE), 6: Field("denotation", "bytes")}
_VALUE: Schema = {
    1: Field("name", "bytes"),
    2: Field("type", _TYPE),
    3: Field("doc_string", "bytes"),
    4: Field("metadata_props", _ENTRY, repeated=True),
}
_TENSOR: Schema = {
    1: Field("dims", "int", repeated=True),
    2: Field("data_type", "int"),
    4: Field("float_data", "float", repeated=True),
    5: Field("int32_data", "int", repeated=True),
    7: Field("int64_data", "int", repeated=True),
    8: Field("name", "bytes"),
    9: Field("raw_data", "bytes"),
    10: Field("double_data", "double", repeated=True),
    12: Field("doc_string", "bytes"),
    13: Field("external_data", _ENTRY, repeated=True),
    14: Field("data_location", "int"),
    16: Field("metadata_props", _ENTRY, repeated=True),
}
_ATTRIBUTE: Schema = {
    1: Field("name", "bytes"),
    2: Field("f", "float"),
    3: Field("i", "int"),
    4: Field("s", "bytes"),
    5: Field("t", _TENSOR),
    6: Field("g", "bytes"),
    7: Field("floats", "float", repeated=True),
    8: Field("ints", "int", repeated=True),
    11: Field("graphs", "bytes", repeated=True),
    13: Field("doc_string", "bytes"),
    20: Field("type", "int"),
    22: Field("sparse_tensor", "bytes"),
    23: Field("sparse_tensors", "bytes", repeated=True),
}
_NODE: Schema = {
    1: Field("input", "bytes", repeated=True),
    2: Field("output", "bytes", repeated=True),
    3: Field("name", "bytes"),
    4: Field("op_type", "bytes"),
    5: Field("attribute", _ATTRIBUTE, repeated=True),
    6: Field("doc_string", "bytes"),
    7: Field("domain", "bytes"),
    9: Field("metadata_props", _ENTRY, repeated=True),
}
_GRAPH: Schema = {
    1: Field("node", _NODE, repeated=True),
    2: Field("name", "bytes"),
    5: Field("initializer", _TENSOR, repeated=True),
    10: Field("doc_string", "bytes"),
    11: Field("input", _VALUE, repeated=True),
    12: Field("output", _VALUE, repeated=True),
    13: Field("value_info", "bytes", repeated=True),  # what a file says of its own is not read
    15: Field("sparse_initializer", "bytes", repeated=True),
    16: Field("metadata_props", _ENTRY, repeated=True),
}
_OPERATOR_SET: Schema = {1: Field("domain", "bytes"), 2: Field("version", "int")}
MODEL: Schema = {
    1: Field("ir_version", "int"),
    2: Field("producer_name", "bytes"),
    3: Field("producer_version", "bytes"),
    4: Field("domain", "bytes"),
    5: Field("model_version", "int"),
    6: Field("doc_string", "bytes"),
    7: Field("graph", _GRAPH),
    8: Field("opset_import", _OPERATOR_SET, repeated=True),
    14: Field("metadata_props", _ENTRY, repeated=True),
    20: Field("training_info", "bytes", repeated=True),
    25: Field("functions", "bytes", repeated=True),
}


@dataclass(frozen=True)
class Node:
    """One operator: names of its inputs and outputs ("" where one is left out)."""

    operator: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: dict[str, Any]


def read_model(data: bytes) -> Message:
    """Return the messages of a model file, one inside the other. Raises ValueError."""
    return read_message(memoryview(data), MODEL)


def text(message: Message, name: str) -> str:
    """Return a field of text, "" where it is left out. Raises ValueError (UnicodeDecodeError)."""
    value: bytes = message.get(name, b"")
    return value.decode()


def tensor(message: Message) -> np.ndarray:
    """Return the numbers of a tensor, as they are held.

    Raises:
        ValueError: a type that no operator here takes, or another count than its shape says.
    """
    kind = message.get("data_type", 0)
    if kind not in RAW_TYPES:
        raise ValueError(f"a tensor of type {kind}")
    if "raw_data" in message:
        flat = np.frombuffer(message["raw_data"], dtype=RAW_TYPES[kind])
    else:
        flat = np.array(message[_NUMBERS_OF[kind]], dtype=RAW_TYPES[kind])
    return flat.astype(HELD_TYPES[kind]).reshape(message["dims"])


def node(message: Message) -> Node:
    """Return a node with the values of its attributes. Raises ValueError."""
    return Node(
        text(message, "op_type"),
        tuple(name.decode() for name in message["input"]),
        tuple(name.decode() for name in message["output"]),
        {text(entry, "name"): _attribute(entry) for entry in message["attribute"]},
    )


# AttributeProto.AttributeType, with the field that holds the value.
_ATTRIBUTE_FIELDS = {1: "f", 2: "i", 3: "s", 4: "t", 6: "floats", 7: "ints"}


def _attribute(message: Message) -> Any:
    kind = message.get("type", 0)
    if kind not in _ATTRIBUTE_FIELDS:
        raise ValueError(f"attribute {text(message, 'name')} of type {kind}")
    field = _ATTRIBUTE_FIELDS[kind]
    # proto3 leaves zeros out.
    value = message.get(field, {"f": 0.0, "i": 0, "s": b""}.get(field))
    if field == "t":
        if value is None:
            raise ValueError(f"attribute {text(message, 'name')} without its tensor")
        return tensor(value)
    return value.decode() if isinstance(value, bytes) else value
