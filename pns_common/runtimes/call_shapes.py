"""What one call of a model file may hold, found from its shapes before it runs.

A file of a few bytes can ask for any amount of memory: a product of a column and a row, a tensor
joined to itself again and again. Every call has the same number of rows, so each tensor in it has a
shape that follows from the file alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import onnx

from pns_common.errors import ModelError
from pns_common.models.contract import CALL_ROWS, LARGEST_CALL, Signature


def signature(value: onnx.ValueInfoProto) -> Signature:
    """Return what a graph says of one of its tensors."""
    tensor = value.type.tensor_type
    shape: list[str | int] = [
        dim.dim_value if dim.HasField("dim_value") else "*" for dim in tensor.shape.dim
    ]
    return value.name, onnx.TensorProto.DataType.Name(tensor.elem_type), shape


def check_calls(proto: onnx.ModelProto, answers: Sequence[tuple[str, str]], name: str) -> None:
    """Check each call that is made of a file; ``proto`` is changed.

    Args:
        proto: a valid file, whose graph has the inputs and outputs of its card.
        answers: the inputs that are features, each with the output that it is read for. A call
            gives one of them CALL_ROWS rows and the others one.
        name: what errors call the file.

    Raises:
        ModelError: a shape does not follow from the file, the tensors of a call are too large, or
            the answers have another shape than (CALL_ROWS, 3).
    """
    graph = proto.graph
    # What a file says of its own tensors is not believed: not of those in between, and not of
    # weights that it lists as inputs too (old files must; from version 4 on weights need not).
    proto.ir_version = max(proto.ir_version, 4)
    del graph.value_info[:]
    weights = {tensor.name for tensor in graph.initializer}
    inputs = [value for value in graph.input if value.name not in weights]
    del graph.input[:]
    graph.input.extend(inputs)
    for value in graph.output:
        value.type.tensor_type.ClearField("shape")
    for given, output in answers:
        for value in graph.input:
            if value.type.tensor_type.shape.dim:
                rows = CALL_ROWS if value.name == given else 1
                value.type.tensor_type.shape.dim[0].dim_value = rows
        _check_call(proto, output, name)


def _check_call(proto: onnx.ModelProto, output: str, name: str) -> None:
    known = {value.name: value for value in _inferred(proto, name)}
    held = 0
    for made in [made for node in proto.graph.node for made in node.output if made]:
        size = _bytes(known[made]) if made in known else None
        if size is None:
            raise ModelError(name, expected="shapes that follow from the file", found=made)
        held += size
    if held > LARGEST_CALL:
        raise ModelError(
            name, expected=f"at most {LARGEST_CALL} bytes in one call", found=str(held)
        )
    shape = signature(known[output])[2]
    if shape != [CALL_ROWS, 3]:
        raise ModelError(name, expected=f"{output} of shape {[CALL_ROWS, 3]}", found=str(shape))


def _inferred(proto: onnx.ModelProto, name: str) -> Iterator[onnx.ValueInfoProto]:
    inference: Any = onnx.shape_inference
    try:
        # Without data_prop, which would compute the tensors that are to be measured.
        graph = inference.infer_shapes(proto, check_type=True, strict_mode=True).graph
    except (ValueError, inference.InferenceError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelError(name, expected="shapes that fit together", found=reason) from error
    yield from graph.value_info
    yield from graph.output


def _bytes(value: onnx.ValueInfoProto) -> int | None:
    """Return a tensor's size in bytes; None if its shape is open, or it holds no numbers."""
    tensor = value.type.tensor_type
    if not tensor.HasField("shape") or tensor.elem_type in (0, onnx.TensorProto.STRING):
        return None
    sizes = [dim.dim_value if dim.HasField("dim_value") else -1 for dim in tensor.shape.dim]
    if min(sizes, default=0) < 0:
        return None
    return math.prod(sizes) * onnx.helper.tensor_dtype_to_np_dtype(tensor.elem_type).itemsize
