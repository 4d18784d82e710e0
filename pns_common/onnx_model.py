"""A model file as a callable η: one ONNX file, checked against its contract before it runs.

Contract: input ``features`` float32 [edges, K], input ``budget`` float32 scalar, output
``correction`` float32 [edges, 3]; standard operators from an allow-list; no external data; the
model card under the metadata key ``pns_card``. Where the card (format 2) names vertex features,
also an input ``vertex_features`` float32 [vertices, L] and an output ``vertex_correction`` float32
[vertices, 3].
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import onnx
import onnxruntime
from google.protobuf.message import DecodeError
from jaxtyping import Float

from pns_common.errors import ModelError
from pns_common.features import FEATURE_COUNT
from pns_common.model_card import CARD_KEY, FORMATS, ModelCard
from pns_common.ring_features import RING_FEATURE_SETS

DEFAULT_MODEL = "paper"
LARGEST_FILE = 64 * 2**20

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

# Rows that one call of the runtime sees. Always the same shape, so that a row's bits depend neither
# on how many rows there are nor on how they are divided.
ROWS = 1024

# (name, element type, shape) with "*" for a free dimension.
Signature = tuple[str, str, list[str | int]]


@dataclass(frozen=True, eq=False)
class OnnxModel:
    """A model file, loaded and checked.

    Attributes:
        name: bundled name, or the file's name without its ending.
        card: what the file says of itself.
        hash: sha256 of the file's bytes.
        size: the file's size in bytes.
    """

    name: str
    card: ModelCard
    hash: str
    size: int
    _data: bytes = field(repr=False)
    _session: Any = field(repr=False)  # onnxruntime ships no types

    def __reduce__(self) -> tuple[Any, ...]:
        # A session cannot travel to a worker process; the file it was made from can.
        return model_from_bytes, (self._data, self.name)

    def __call__(self, features: Float[np.ndarray, "N K"], budget: float) -> np.ndarray:
        """Corrections (N, 3) float32, for features (N, K) and a dimensionless budget."""
        return self._answers("correction", "features", features, budget)

    def vertex_correction(self, features: Float[np.ndarray, "N L"], budget: float) -> np.ndarray:
        """Weights (N, 3) float32 for the rings of old vertices, where the card has features.

        Raises:
            ModelError: the model has no vertex rule.
        """
        if self.card.vertex_features is None:
            raise ModelError(self.name, expected="a vertex rule", found="none")
        return self._answers("vertex_correction", "vertex_features", features, budget)

    def _answers(
        self, output: str, given: str, features: Float[np.ndarray, "N K"], budget: float
    ) -> np.ndarray:
        rows = np.asarray(features, dtype=np.float32)
        corrections = np.empty((len(rows), 3), dtype=np.float32)
        # The runtime wants every input, also those that this output does not need: one row each.
        widths = feature_inputs(self.card)
        inputs = {name: np.zeros((1, width), dtype=np.float32) for name, width in widths}
        inputs["budget"] = np.asarray(budget, dtype=np.float32)
        for start in range(0, len(rows), ROWS):
            piece = rows[start : start + ROWS]
            padded = np.zeros((ROWS, rows.shape[1]), dtype=np.float32)
            padded[: len(piece)] = piece
            answer = self._run(output, inputs | {given: padded})
            corrections[start : start + ROWS] = answer[: len(piece)]
        return corrections

    def _run(self, output: str, inputs: dict[str, np.ndarray]) -> np.ndarray:
        try:
            (answer,) = self._session.run([output], inputs)
        except Exception as error:  # onnxruntime's errors share no base below Exception
            found = str(error).splitlines()[0]
            raise ModelError(
                self.name, expected="a graph that runs to its end", found=found
            ) from error
        answer = np.asarray(answer)
        if answer.shape != (ROWS, 3):
            raise ModelError(
                self.name, expected=f"corrections of shape ({ROWS}, 3)", found=f"{answer.shape}"
            )
        return answer


def bundled_models() -> list[str]:
    """Names of the model files that come with the package."""
    folder = resources.files("pns_common") / "models"
    return sorted(
        entry.name.removesuffix(".onnx")
        for entry in folder.iterdir()
        if entry.name.endswith(".onnx")
    )


def load_model(source: str | Path | None = None) -> OnnxModel:
    """Load a model file.

    Args:
        source: a path, the name of a bundled model, or None for the default.

    Raises:
        ModelError: there is no such file, or it breaks the contract; says which part.
    """
    source = DEFAULT_MODEL if source is None else source
    if str(source) in bundled_models():
        data = (resources.files("pns_common") / "models" / f"{source}.onnx").read_bytes()
        return model_from_bytes(data, name=str(source))
    path = Path(source)
    if not path.is_file():
        names = ", ".join(bundled_models()) or "none"
        raise ModelError(str(source), expected=f"a file or a bundled name ({names})", found="none")
    if path.stat().st_size > LARGEST_FILE:
        raise ModelError(
            str(path), expected=f"at most {LARGEST_FILE} bytes", found=str(path.stat().st_size)
        )
    return model_from_bytes(path.read_bytes(), name=path.stem)


def model_from_bytes(data: bytes, name: str) -> OnnxModel:
    """Check the bytes of a model file and make it callable.

    Raises:
        ModelError: the file breaks the contract.
    """
    proto = _parse(data, name)
    _check_operators(proto, name)
    _check_valid(proto, name)
    card = _read_card(proto, name)
    _check_interface(proto.graph, card, name)
    runtime: Any = onnxruntime
    options = runtime.SessionOptions()
    # The caller divides the work; one thread here keeps the bits the same everywhere.
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = runtime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors share no base below Exception
        raise ModelError(
            name, expected="a graph that onnxruntime runs", found=str(error)
        ) from error
    digest = hashlib.sha256(data).hexdigest()
    return OnnxModel(name, card, digest, len(data), data, session)


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
    inputs = [_signature(value) for value in graph.input if value.name not in weights]
    outputs = [_signature(value) for value in graph.output]
    widths = feature_inputs(card)
    wanted_in: list[Signature] = [(what, "FLOAT", ["*", width]) for what, width in widths]
    wanted_in.append(("budget", "FLOAT", []))
    names = ("correction", "vertex_correction")[: len(widths)]
    wanted_out: list[Signature] = [(what, "FLOAT", ["*", 3]) for what in names]
    for what, wanted, found in [("inputs", wanted_in, inputs), ("outputs", wanted_out, outputs)]:
        if sorted(wanted, key=str) != sorted(found, key=str):
            raise ModelError(name, expected=f"{what} {wanted}", found=f"{found}")


def feature_inputs(card: ModelCard) -> list[tuple[str, int]]:
    """The inputs that are features, and how many columns each has."""
    widths = [("features", FEATURE_COUNT[card.features])]
    if card.vertex_features is not None:
        widths.append(("vertex_features", RING_FEATURE_SETS[card.vertex_features].count))
    return widths


def _or(values: tuple[int, ...]) -> str:
    return " or ".join(str(value) for value in values)


def _signature(value: onnx.ValueInfoProto) -> Signature:
    tensor = value.type.tensor_type
    shape: list[str | int] = [
        dim.dim_value if dim.HasField("dim_value") else "*" for dim in tensor.shape.dim
    ]
    return value.name, onnx.TensorProto.DataType.Name(tensor.elem_type), shape
