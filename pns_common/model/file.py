"""Model files: found, read, checked against their contract, and loaded.

A file is one ONNX graph of at most ``LARGEST_FILE`` bytes: standard operators from an allow-list,
no data outside it, the card under the metadata key ``pns_card``. In format 1 inputs are ``budget``
(a float32 scalar) and ``features`` [edges, K], the output is ``correction`` [edges, 3]. In format 5
each network has an input and an output of its own, as ``session.networks`` lists them. Hidden
tensors of one call fill at most ``LARGEST_CALL`` bytes.

The hashes of the bundled files stand in ``models/SHA256SUMS``: ``sha256sum -c`` reads it.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeGuard

from pns_common.errors import ModelError, ParameterError
from pns_common.model.card import CARD_KEY, DIRECTED_FORMAT, ModelCard
from pns_common.model.session import (
    CHUNK_ROWS,
    CPU,
    Model,
    Network,
    OnnxModel,
    first_line,
    networks,
)

if TYPE_CHECKING:
    from onnx import ModelProto, NodeProto, ValueInfoProto

DEFAULT_MODEL = "general"
# Of a bundled model over Loop, the one that takes over on meshes of polygons.
COMPANIONS: Mapping[str, str] = MappingProxyType({"general": "general-quad"})
BUNDLED = resources.files("pns_common") / "models"
MANIFEST = "SHA256SUMS"

# An empty node of two bytes takes 150 once it is parsed, so this also bounds the memory of parsing.
LARGEST_FILE = 2 * 2**20
MOST_NODES = 1000
# Bytes of all tensors that a call of CHUNK_ROWS rows makes, as if none were freed before its end.
LARGEST_CALL = 256 * 2**20

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

# (name, element type, shape) with "*" for a free dimension.
Signature = tuple[str, str, list[str | int]]


def load_model(
    source: str | os.PathLike[str] | None = None, providers: Sequence[str] = CPU
) -> OnnxModel:
    """Load a model file.

    Args:
        source: A bundled name, else a path; None for the default model. A name wins over a file
            that is called alike: "./paper" and Path("paper") are files.
        providers: Execution providers of onnxruntime, preferred first.

    Raises:
        ParameterError: ``source`` is neither a name nor a path, or a provider is not available.
        ModelError: there is no such file, it breaks the contract (says which part), a bundled
            file is not the one that SHA256SUMS names, or there is no package onnx to check others.

    Example:
        >>> load_model("paper").name
        'paper'
    """
    source = DEFAULT_MODEL if source is None else source
    if not isinstance(source, str | os.PathLike):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ParameterError("source", source, expected="a bundled name, a path, or None")
    if _is_bundled(source):
        data = (BUNDLED / f"{source}.onnx").read_bytes()
        # Its hash stands for the check, which takes longer than to refine a small mesh.
        return OnnxModel(source, _listed_hash(BUNDLED, source, data), data, providers)
    path = Path(source)
    if not path.is_file():
        names = ", ".join(bundled_models(companions=True)) or "none"
        raise ModelError(str(source), expected=f"a file or a bundled name ({names})", found="none")
    _check_size(path.stat().st_size, str(path))
    return model_from_bytes(path.read_bytes(), path.stem, providers)


def _is_bundled(source: str | os.PathLike[str]) -> TypeGuard[str]:
    return isinstance(source, str) and source in bundled_models(companions=True)


def bundled_models(*, companions: bool = False) -> list[str]:
    """Return the names of the model files that come with the package.

    Companions, which other models bring for meshes of polygons, are named if they are asked for.
    """
    files = (entry.name for entry in BUNDLED.iterdir())
    names = {name.removesuffix(".onnx") for name in files if name.endswith(".onnx")}
    return sorted(names if companions else names - set(COMPANIONS.values()))


def companion_of(model: Model) -> OnnxModel:
    """Return the model that takes polygons over from one, opened once, on the same providers."""
    return _kept(COMPANIONS[model.name], tuple(getattr(model, "providers", CPU)))


@cache
def _kept(name: str, providers: tuple[str, ...]) -> OnnxModel:
    return load_model(name, providers)


def model_from_bytes(data: bytes, name: str, providers: Sequence[str] = CPU) -> OnnxModel:
    """Check the bytes of a model file and open it.

    Raises:
        ParameterError: a provider is not available here.
        ModelError: the file breaks the contract; ``name`` is what the error calls it.
    """
    card = check_file(data, name)
    return OnnxModel(name, hashlib.sha256(data).hexdigest(), data, providers, card)


def write_manifest(folder: Path) -> None:
    """Write the hashes of all model files of a folder into its SHA256SUMS, in one step."""
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        for path in sorted(folder.glob("*.onnx"))
    ]
    new = folder / f"{MANIFEST}.new"
    new.write_text("".join(lines))
    new.replace(folder / MANIFEST)


def check_file(data: bytes, name: str) -> ModelCard:
    """Return the card of a file that keeps the contract.

    Raises:
        ModelError: the file breaks the contract; says which part.
    """
    proto = _parsed(data, name)
    card = _card(proto, name)
    _check_graph(proto, name)
    _check_valid(proto, name)
    held = networks(card)
    _check_signatures(proto, card, held, name)
    for network in held:
        _check_call(proto, network, name)
    return card


def _listed_hash(folder: Traversable, name: str, data: bytes) -> str:
    """Return the hash of a bundled file, which the manifest beside it names. Raises ModelError."""
    path = folder / MANIFEST
    if not path.is_file():
        raise ModelError(name, expected=f"{MANIFEST} beside the bundled models", found="none")
    listed = dict(line.split()[::-1] for line in path.read_text().splitlines())
    wanted = listed.get(f"{name}.onnx", "not listed")
    found = hashlib.sha256(data).hexdigest()
    if found != wanted:
        raise ModelError(name, expected=f"sha256 {wanted} ({MANIFEST})", found=found)
    return found


def _check_size(size: int, name: str) -> None:
    if size > LARGEST_FILE:
        raise ModelError(name, expected=f"at most {LARGEST_FILE} bytes", found=str(size))


def _parsed(data: bytes, name: str) -> ModelProto:
    """Parse a file of bounded size. Raises ModelError."""
    try:
        import onnx  # lazy: an import of 0.2 s
        from google.protobuf.message import DecodeError
    except ImportError as error:
        expected = "the package onnx, which checks files that are not bundled"
        raise ModelError(name, expected=expected, found="none") from error
    _check_size(len(data), name)
    try:
        proto = onnx.load_from_string(data)
    except DecodeError as error:
        raise ModelError(name, expected="an ONNX file", found="other bytes") from error
    nodes = len(proto.graph.node)
    if nodes > MOST_NODES:
        raise ModelError(name, expected=f"at most {MOST_NODES} nodes", found=str(nodes))
    return proto


def _card(proto: ModelProto, name: str) -> ModelCard:
    """Read the only card of a file. Raises ModelError."""
    texts = [entry.value for entry in proto.metadata_props if entry.key == CARD_KEY]
    if len(texts) != 1:
        raise ModelError(name, expected=f"one metadata entry {CARD_KEY}", found=str(len(texts)))
    try:
        return ModelCard.from_json(texts[0])
    except ValueError as error:
        expected = "a model card of format 1 or 5"
        raise ModelError(name, expected=expected, found=str(error)) from error


def _check_graph(proto: ModelProto, name: str) -> None:
    """Check for one graph of allowed operators whose weights are dense and inside the file."""
    from onnx import TensorProto

    if proto.functions or proto.training_info:
        raise ModelError(name, expected="one graph", found="functions or training graphs beside it")
    graph = proto.graph
    if graph.sparse_initializer:
        raise ModelError(name, expected="dense weights", found="a sparse initializer")
    tensors = list(graph.initializer)
    for node in graph.node:
        _check_operator(node, name)
        for attribute in node.attribute:
            if attribute.HasField("g") or attribute.graphs:
                raise ModelError(name, expected="one graph", found=f"a graph in {node.op_type}")
            if attribute.HasField("sparse_tensor") or attribute.sparse_tensors:
                raise ModelError(name, expected="dense weights", found="a sparse tensor")
            tensors += [attribute.t, *attribute.tensors]
    for tensor in tensors:
        if tensor.data_location == TensorProto.EXTERNAL or tensor.external_data:
            raise ModelError(name, expected="all weights inside the file", found="external data")


def _check_operator(node: NodeProto, name: str) -> None:
    if node.domain not in ("", "ai.onnx") or node.op_type not in ALLOWED_OPERATORS:
        operator = f"{node.domain}.{node.op_type}" if node.domain else node.op_type
        raise ModelError(name, expected="operators from the allow-list", found=operator)
    for attribute in node.attribute:
        # A Split that names another number of outputs ends the process of onnxruntime.
        if attribute.name == "num_outputs" and attribute.i != len(node.output):
            found = f"{node.op_type} with {len(node.output)} outputs, not {attribute.i}"
            raise ModelError(name, expected="shapes that fit together", found=found)


def _check_valid(proto: ModelProto, name: str) -> None:
    import onnx

    checker: Any = onnx.checker
    try:
        checker.check_model(proto)
    except (ValueError, onnx.checker.ValidationError) as error:
        raise ModelError(name, expected="a valid ONNX model", found=first_line(error)) from error


def _check_signatures(
    proto: ModelProto, card: ModelCard, held: Sequence[Network], name: str
) -> None:
    """Check inputs and outputs against the networks of the card. Raises ModelError."""
    graph = proto.graph
    weights = {tensor.name for tensor in graph.initializer}
    inputs = [_signature(value) for value in graph.input if value.name not in weights]
    outputs = [_signature(value) for value in graph.output]
    rows: list[Signature] = [(each.given, "FLOAT", ["*", each.columns]) for each in held]
    answers: list[Signature] = [(each.answer, "FLOAT", ["*", each.answer_columns]) for each in held]
    budget: list[Signature] = [("budget", "FLOAT", [])] * (card.format != DIRECTED_FORMAT)
    wanted: list[tuple[str, list[Signature], list[Signature]]] = [
        ("inputs", [*rows, *budget], inputs),
        ("outputs", answers, outputs),
    ]
    for what, expected, found in wanted:
        if sorted(expected, key=str) != sorted(found, key=str):
            raise ModelError(name, expected=f"{what} {expected}", found=f"{found}")


def _signature(value: ValueInfoProto) -> Signature:
    from onnx import TensorProto

    tensor = value.type.tensor_type
    shape: list[str | int] = [
        dim.dim_value if dim.HasField("dim_value") else "*" for dim in tensor.shape.dim
    ]
    return value.name, TensorProto.DataType.Name(tensor.elem_type), shape


def _check_call(proto: ModelProto, network: Network, name: str) -> None:
    """Check what one call of a network makes: a small file can ask for any amount of memory.

    Every shape must follow from the file and from CHUNK_ROWS rows of the network's input. Other
    inputs get one row. Raises ModelError.
    """
    known = {value.name: value for value in _inferred(proto, network, name)}
    held = 0
    for made in (made for node in proto.graph.node for made in node.output if made):
        size = _bytes(known[made]) if made in known else None
        if size is None:
            raise ModelError(name, expected="shapes that follow from the file", found=made)
        held += size
    if held > LARGEST_CALL:
        expected = f"at most {LARGEST_CALL} bytes in one call"
        raise ModelError(name, expected=expected, found=str(held))
    wanted, shape = [CHUNK_ROWS, network.answer_columns], _signature(known[network.answer])[2]
    if shape != wanted:
        raise ModelError(name, expected=f"{network.answer} of shape {wanted}", found=str(shape))


def _inferred(proto: ModelProto, network: Network, name: str) -> Iterator[ValueInfoProto]:
    """Infer the shapes of a call; what the file itself says of its tensors is not believed."""
    from onnx import ModelProto, shape_inference

    asked = ModelProto()
    asked.CopyFrom(proto)
    graph = asked.graph
    # From version 4 on weights need not be inputs, whose declared shapes inference would believe.
    asked.ir_version = max(asked.ir_version, 4)
    del graph.value_info[:]
    weights = {tensor.name for tensor in graph.initializer}
    inputs = [value for value in graph.input if value.name not in weights]
    del graph.input[:]
    graph.input.extend(inputs)
    for value in graph.output:
        value.type.tensor_type.ClearField("shape")
    for value in graph.input:
        if value.type.tensor_type.shape.dim:
            rows = CHUNK_ROWS if value.name == network.given else 1
            value.type.tensor_type.shape.dim[0].dim_value = rows
    inference: Any = shape_inference
    try:
        # Without data_prop, which would compute the tensors that are to be measured.
        inferred = inference.infer_shapes(asked, check_type=True, strict_mode=True).graph
    except (ValueError, inference.InferenceError) as error:
        expected = "shapes that fit together"
        raise ModelError(name, expected=expected, found=first_line(error)) from error
    yield from inferred.value_info
    yield from inferred.output


def _bytes(value: ValueInfoProto) -> int | None:
    """Return a tensor's size in bytes; None if its shape is open, or it holds no numbers."""
    from onnx import TensorProto, helper

    tensor = value.type.tensor_type
    if not tensor.HasField("shape") or tensor.elem_type in (0, TensorProto.STRING):
        return None
    sizes = [dim.dim_value if dim.HasField("dim_value") else -1 for dim in tensor.shape.dim]
    if min(sizes, default=0) < 0:
        return None
    return math.prod(sizes) * helper.tensor_dtype_to_np_dtype(tensor.elem_type).itemsize
