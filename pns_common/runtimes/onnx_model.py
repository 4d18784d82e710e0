"""A model file as a callable η: loaded from the package or a path, and called in pieces.

A network whose weights are tied is run by the project's own program (tied_network/), whatever is
installed, with the same bits everywhere. Any other is run by onnxruntime where it and the package
onnx are installed, by numpy where they are not: the same files are taken and refused, and the
answers differ by the rounding of single precision.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, TypeGuard, runtime_checkable

import numpy as np
from jaxtyping import Float

from pns_common.errors import ModelError, ParameterError
from pns_common.models.card import ModelCard
from pns_common.models.contract import CALL_ROWS, answer_to, feature_inputs
from pns_common.models.manifest import check_listed
from pns_common.models.part_count import check_part_count
from pns_common.runtimes.tied_network import TiedNetwork, open_tied_network

DEFAULT_MODEL = "general"
LARGEST_FILE = 8 * 2**20
BUNDLED = resources.files("pns_common") / "models"

__all__ = [
    "BUNDLED",
    "DEFAULT_MODEL",
    "LARGEST_FILE",
    "Network",
    "OnnxModel",
    "bundled_models",
    "load_model",
    "model_from_bytes",
    "model_name",
]


@runtime_checkable
class Network(Protocol):
    """A checked graph that something runs."""

    def run(self, output: str, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return one output of the graph. Raises what its runtime raises."""
        ...


# The bytes of a file and what errors call it -> its card and its network; raises ModelError.
Runtime = Callable[[bytes, str], tuple[ModelCard, Network | TiedNetwork]]


def open_model(data: bytes, name: str) -> tuple[ModelCard, Network | TiedNetwork]:
    """Open a model file by the project's own program where it can be, else as is installed.

    Raises:
        ModelError: the file breaks the contract.
    """
    return open_tied_network(data, name) or installed_runtime()(data, name)


def installed_runtime() -> Runtime:
    """Return what runs any graph here: onnxruntime where it is installed, else numpy."""
    if find_spec("onnxruntime") is not None and find_spec("onnx") is not None:
        from pns_common.runtimes.onnx_session import open_session

        return open_session
    from pns_common.runtimes.numpy_network import open_network

    return open_network


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
    card: ModelCard = field(repr=False)
    hash: str
    size: int = field(repr=False)
    _data: bytes = field(repr=False)
    _network: Network | TiedNetwork = field(repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        # A network cannot travel to a worker process; the file it was made from can.
        return model_from_bytes, (self._data, self.name)

    def __call__(self, features: Float[np.ndarray, "N K"], budget: float) -> np.ndarray:
        """Return corrections (N, 3) float32, for features (N, K) and a dimensionless budget.

        Raises:
            ModelError: the graph does not run to its end, or answers in another shape.
        """
        return self._answers("features", features, budget)

    def vertex_correction(self, features: Float[np.ndarray, "N L"], budget: float) -> np.ndarray:
        """Return weights (N, 3) float32 for the rings of old vertices, where the card has features.

        Raises:
            ModelError: the model has no vertex rule; and as for edges.
        """
        if self.card.vertex_features is None:
            raise ModelError(self.name, expected="a vertex rule", found="none")
        return self._answers("vertex_features", features, budget)

    def _answers(self, given: str, features: Float[np.ndarray, "N K"], budget: float) -> np.ndarray:
        # Not a protocol: to ask for one takes as long as fifty rows.
        if isinstance(self._network, TiedNetwork):
            try:
                return self._network.answers(given, features, budget)
            except ValueError as error:
                raise _broken_off(self.name, str(error)) from error
        return self._answers_in_calls(self._network, given, features, budget)

    def _answers_in_calls(
        self, network: Network, given: str, features: Float[np.ndarray, "N K"], budget: float
    ) -> np.ndarray:
        rows = np.asarray(features, dtype=np.float32)
        corrections = np.empty((len(rows), 3), dtype=np.float32)
        # The runtime wants every input, also those that this output does not need: one row each.
        widths = feature_inputs(self.card)
        inputs = {name: np.zeros((1, width), dtype=np.float32) for name, width in widths}
        inputs["budget"] = np.asarray(budget, dtype=np.float32)
        for start in range(0, len(rows), CALL_ROWS):
            piece = rows[start : start + CALL_ROWS]
            if len(piece) < CALL_ROWS:
                missing = np.zeros((CALL_ROWS - len(piece), piece.shape[1]), dtype=np.float32)
                piece = np.concatenate([piece, missing])
            answer = self._run(network, answer_to(given), inputs | {given: piece})
            corrections[start : start + CALL_ROWS] = answer[: len(rows) - start]
        return corrections

    def _run(self, network: Network, output: str, inputs: dict[str, np.ndarray]) -> np.ndarray:
        try:
            answer = np.asarray(network.run(output, inputs))
        except Exception as error:  # onnxruntime's errors share no base below Exception
            reason = [*str(error).splitlines(), type(error).__name__][0]
            raise _broken_off(self.name, reason) from error
        if answer.shape != (CALL_ROWS, 3):
            raise ModelError(
                self.name,
                expected=f"corrections of shape ({CALL_ROWS}, 3)",
                found=f"{answer.shape}",
            )
        return answer


def _broken_off(name: str, reason: str) -> ModelError:
    return ModelError(name, expected="a graph that runs to its end", found=reason)


def bundled_models() -> list[str]:
    """Return the names of the model files that come with the package."""
    return sorted(
        entry.name.removesuffix(".onnx")
        for entry in BUNDLED.iterdir()
        if entry.name.endswith(".onnx")
    )


def model_name(source: str | Path) -> str:
    """Return what the model of a bundled name or a file is called: the name, or the file's stem."""
    return source if _is_bundled(source) else Path(source).stem


def load_model(source: str | Path | None = None) -> OnnxModel:
    """Load a model file.

    Args:
        source: the name of a bundled model, else a path; None for the default. A name wins over a
            file that is called the same: "./paper" and Path("paper") are files.

    Raises:
        ParameterError: it is neither a name nor a path.
        ModelError: there is no such file, it breaks the contract (says which part), or it is not
            the bundled one that its name stands for.
    """
    source = DEFAULT_MODEL if source is None else source
    if not isinstance(source, str | os.PathLike):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ParameterError("source", source, expected="a bundled name, a path, or None")
    if _is_bundled(source):
        data = (BUNDLED / f"{source}.onnx").read_bytes()
        check_listed(BUNDLED, source, data)
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
    """Return whether it is a bundled name; a Path never is."""
    return isinstance(source, str) and source in bundled_models()


def model_from_bytes(data: bytes, name: str, runtime: Runtime | None = None) -> OnnxModel:
    """Check the bytes of a model file and make it callable.

    Args:
        data: the file.
        name: what the model is called.
        runtime: what opens it; None for what ``open_model`` chooses.

    Raises:
        ModelError: the file breaks the contract.
    """
    check_part_count(data, name)
    card, network = (runtime or open_model)(data, name)
    digest = hashlib.sha256(data).hexdigest()
    return OnnxModel(name, card, digest, len(data), data, network)
