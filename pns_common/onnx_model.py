"""A model file as a callable η: loaded from the package or a path, and called in pieces."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import onnxruntime
from jaxtyping import Float

from pns_common.errors import ModelError
from pns_common.model_card import ModelCard
from pns_common.model_check import ALLOWED_OPERATORS, answer_to, check_file, feature_inputs
from pns_common.model_shapes import ROWS

DEFAULT_MODEL = "full"
LARGEST_FILE = 64 * 2**20
BUNDLED = resources.files("pns_common") / "models"

__all__ = [
    "ALLOWED_OPERATORS",
    "BUNDLED",
    "DEFAULT_MODEL",
    "LARGEST_FILE",
    "ROWS",
    "OnnxModel",
    "bundled_models",
    "feature_inputs",
    "load_model",
    "model_from_bytes",
    "model_name",
]


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
        return self._answers("features", features, budget)

    def vertex_correction(self, features: Float[np.ndarray, "N L"], budget: float) -> np.ndarray:
        """Weights (N, 3) float32 for the rings of old vertices, where the card has features.

        Raises:
            ModelError: the model has no vertex rule.
        """
        if self.card.vertex_features is None:
            raise ModelError(self.name, expected="a vertex rule", found="none")
        return self._answers("vertex_features", features, budget)

    def _answers(self, given: str, features: Float[np.ndarray, "N K"], budget: float) -> np.ndarray:
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
            answer = self._run(answer_to(given), inputs | {given: padded})
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
    return sorted(
        entry.name.removesuffix(".onnx")
        for entry in BUNDLED.iterdir()
        if entry.name.endswith(".onnx")
    )


def model_name(source: str | Path) -> str:
    """What the model of a bundled name or a file is called: the name, or the file's stem."""
    return source if _is_bundled(source) else Path(source).stem


def load_model(source: str | Path | None = None) -> OnnxModel:
    """Load a model file.

    Args:
        source: the name of a bundled model, else a path; None for the default. A name wins over a
            file that is called the same: "./paper" and Path("paper") are files.

    Raises:
        ModelError: there is no such file, or it breaks the contract; says which part.
    """
    source = DEFAULT_MODEL if source is None else source
    if _is_bundled(source):
        data = (BUNDLED / f"{source}.onnx").read_bytes()
        return model_from_bytes(data, model_name(source))
    path = Path(source)
    if not path.is_file():
        names = ", ".join(bundled_models()) or "none"
        raise ModelError(str(source), expected=f"a file or a bundled name ({names})", found="none")
    if path.stat().st_size > LARGEST_FILE:
        raise ModelError(
            str(path), expected=f"at most {LARGEST_FILE} bytes", found=str(path.stat().st_size)
        )
    return model_from_bytes(path.read_bytes(), model_name(path))


def _is_bundled(source: str | Path) -> TypeGuard[str]:
    """Whether it is a bundled name; a Path never is."""
    return isinstance(source, str) and source in bundled_models()


def model_from_bytes(data: bytes, name: str) -> OnnxModel:
    """Check the bytes of a model file and make it callable.

    Raises:
        ModelError: the file breaks the contract.
    """
    card = check_file(data, name)
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
