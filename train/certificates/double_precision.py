"""A model file's network in double precision, by onnx's own reference evaluator.

onnxruntime runs several operators in single precision only. The file is the same one: its weights
are widened, which is exact, and every operator then computes in double.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import scipy.special
from jaxtyping import Float
from onnx import NodeProto, TensorProto, numpy_helper
from onnx.reference import ReferenceEvaluator
from onnx.reference.op_run import OpRun

from pns_common import ModelError
from pns_common.model.card import ModelCard
from pns_common.model.file import BUNDLED, bundled_models
from pns_common.model.session import OnnxModel, networks


class Erf(OpRun):
    """erf in the precision of its input: the evaluator's own rounds to single."""

    def _run(self, x: np.ndarray) -> tuple[np.ndarray]:
        return (scipy.special.erf(x),)


class Gelu(OpRun):
    """x Φ(x), or its tanh approximation: the evaluator's own goes through its own erf."""

    op_domain = ""

    def _run(self, x: np.ndarray, approximate: str = "none") -> tuple[np.ndarray]:
        if approximate == "tanh":
            return (x / 2 * (1 + np.tanh(np.sqrt(2 / np.pi) * (x + 0.044715 * x**3))),)
        return (x * scipy.special.ndtr(x),)


@dataclass(frozen=True, eq=False)
class DoubleModel:
    """A model file in double precision; it keeps the library's `Model` protocol."""

    name: str
    card: ModelCard
    hash: str
    _evaluator: Any = field(repr=False)

    def run(
        self, given: str, rows: Float[np.ndarray, "N K"], budget: float = 1.0
    ) -> Float[np.ndarray, "N A"]:
        """Return the answers of the network that reads the input ``given``, float64.

        Raises:
            ModelError: the graph does not run in double precision.
        """
        (output,) = (each.answer for each in networks(self.card) if each.given == given)
        # The evaluator wants every input, also those that this output does not need.
        inputs = {each.given: np.zeros((1, each.columns)) for each in networks(self.card)}
        inputs[given] = np.asarray(rows, dtype=np.float64)
        inputs["budget"] = np.asarray(budget, dtype=np.float64)
        # A hostile file may overflow or make a NaN; the operator looks at what comes out.
        with np.errstate(all="ignore"):
            try:
                (correction,) = self._evaluator.run([output], inputs)
            except Exception as error:  # the evaluator's errors share no base below Exception
                raise ModelError(
                    self.name, expected="a graph that runs in double precision", found=str(error)
                ) from error
        return correction


def double_model(model: OnnxModel, data: bytes) -> DoubleModel:
    """Open the network of a checked model file (`data` are its bytes) in double precision."""
    proto = onnx.load_from_string(data)
    for tensor in proto.graph.initializer:
        tensor.CopyFrom(_widened(tensor))
    for node in proto.graph.node:
        _widen_node(node)
    for value in (*proto.graph.input, *proto.graph.output):
        value.type.tensor_type.elem_type = TensorProto.DOUBLE
    evaluator = ReferenceEvaluator(proto, new_ops=[Erf, Gelu])
    return DoubleModel(model.name, model.card, model.hash, evaluator)


def read_bytes(source: str | Path) -> bytes:
    """Read the bytes of a bundled model or of a file that `load_model` has accepted."""
    if isinstance(source, str) and source in bundled_models(companions=True):
        return (BUNDLED / f"{source}.onnx").read_bytes()
    return Path(source).read_bytes()


def _widen_node(node: NodeProto) -> None:
    """Make a node's own single precision constants, or a cast to single precision, double."""
    for attribute in node.attribute:
        if attribute.name == "value":
            attribute.t.CopyFrom(_widened(attribute.t))
        elif attribute.name in ("value_float", "value_floats"):
            scalar = attribute.name == "value_float"
            values = np.array(attribute.f if scalar else list(attribute.floats), dtype=np.float64)
            attribute.CopyFrom(onnx.helper.make_attribute("value", numpy_helper.from_array(values)))
        elif node.op_type == "Cast" and attribute.name == "to":
            attribute.i = TensorProto.DOUBLE if attribute.i == TensorProto.FLOAT else attribute.i


def _widened(tensor: TensorProto) -> TensorProto:
    if tensor.data_type != TensorProto.FLOAT:
        return tensor
    return numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float64), tensor.name)
