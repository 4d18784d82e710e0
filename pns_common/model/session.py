"""A model as the operator calls it: a card, and networks that onnxruntime runs.

Rows go to onnxruntime in chunks of ``CHUNK_ROWS``, counted from row 0 of the call, on sessions of
one thread, one session for each calling thread. A row's bits depend on the row alone, not on the
chunk it stands in, on its neighbours or on the number of threads.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Float32

from pns_common.errors import ModelError, ParameterError
from pns_common.model.card import (
    CARD_KEY,
    DIRECTED_FEATURES,
    DIRECTED_FORMAT,
    EDGE_FEATURES,
    ModelCard,
)

# Rows of one call of onnxruntime. 1,024 take a fifth longer a row, 8,192 and 16,384 as long.
CHUNK_ROWS = 4096
# Chunks are padded to a multiple: for a single row onnxruntime may call another kernel.
ROW_MULTIPLE = 16
CPU = ("CPUExecutionProvider",)
# Answers of a directed edge without a face's.
HEADS = 8


@runtime_checkable
class Model(Protocol):
    """Networks with a card, each called by the name of what it reads."""

    @property
    def card(self) -> ModelCard:
        """The model's card."""
        ...

    @property
    def name(self) -> str:
        """Name in reports."""
        ...

    @property
    def hash(self) -> str:
        """The sha256 of the model file."""
        ...

    def run(
        self, given: str, rows: Float[np.ndarray, "N K"], budget: float = 1.0
    ) -> Float[np.ndarray, "N A"]:
        """Return the answers of the network that reads the input ``given``.

        That of format 1 reads "features" and answers η in edge frames, of norm ≤ budget.
        """
        ...


@dataclass(frozen=True)
class Network:
    """One network of a model file: the input that it reads, its columns, and its output's."""

    given: str
    columns: int
    answer: str
    answer_columns: int


def networks(card: ModelCard) -> tuple[Network, ...]:
    """Return the networks that a file with this card holds."""
    if card.format != DIRECTED_FORMAT:
        return (Network("features", EDGE_FEATURES[card.features], "correction", 3),)
    assert card.width is not None
    assert card.hidden is not None
    assert card.rounds is not None
    width, hidden, answers = card.width, card.hidden, heads_of(card)
    encoder = Network("features", DIRECTED_FEATURES[card.features], "state", width)
    rounds = (
        network
        for n in range(1, card.rounds + 1)
        for network in (
            Network(f"pooled_{n}", 2 * width, f"told_{n}", 2 * hidden),
            Network(f"messages_{n}", 2 * width + hidden, f"update_{n}", width),
        )
    )
    return encoder, *rounds, Network("states", width, "heads", answers)


def heads_of(card: ModelCard) -> int:
    """Return how many answers a directed edge gives: one more where faces have a vertex."""
    return HEADS + (card.base == "catmull-clark")


class OnnxModel:
    """A checked model file, run by onnxruntime.

    Attributes:
        name: Bundled name, or the file's name without its ending.
        card: What the file says of itself.
        hash: sha256 of the file's bytes.
        data: The file's bytes.
        size: How many these are.
        providers: Execution providers of onnxruntime that run it, preferred first.
        feature_type: In which type features are best given: they are not copied then.
    """

    feature_type = np.float32

    def __init__(
        self,
        name: str,
        digest: str,
        data: bytes,
        providers: Sequence[str] = CPU,
        card: ModelCard | None = None,
    ):
        """Open a file that is known to keep the contract; ``card`` is read where it is None.

        Raises:
            ParameterError: a provider is not available here.
            ModelError: onnxruntime cannot run the graph.
        """
        self.name, self.hash, self.size = name, digest, len(data)
        self.data, self._wanted, self._of_thread = data, tuple(providers), threading.local()
        session = self._session()
        self.providers: tuple[str, ...] = tuple(session.get_providers())
        self.card = card or ModelCard.from_json(
            session.get_modelmeta().custom_metadata_map[CARD_KEY]
        )
        self._networks = {network.given: network for network in networks(self.card)}
        self._unread = {
            network.given: np.zeros((1, network.columns), dtype=np.float32)
            for network in self._networks.values()
        }

    def __repr__(self) -> str:
        return f"OnnxModel(name={self.name!r}, hash={self.hash!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        # A session cannot travel to another process; the file's bytes can.
        return OnnxModel, (self.name, self.hash, self.data, self._wanted, self.card)

    def run(
        self, given: str, rows: Float[np.ndarray, "N K"], budget: float = 1.0
    ) -> Float32[np.ndarray, "N A"]:
        """Run the network that reads the input ``given``.

        Args:
            given: "features", or another of `networks`.
            rows: what it reads.
            budget: dimensionless; read by format 1 alone.

        Raises:
            ParameterError: rows of another shape.
            ModelError: the model has no such network, the graph fails, or an answer is not finite
                or of another shape.
        """
        network = self._networks.get(given)
        if network is None:
            raise ModelError(self.name, expected=f"a network that reads {given}", found="none")
        if rows.ndim != 2 or rows.shape[1] != network.columns:
            expected = f"an array of shape (N, {network.columns})"
            raise ParameterError(given, rows.shape, expected=expected)
        # onnxruntime asks for all inputs: a row for those that are not read.
        session, inputs = self._session(), self._unread.copy()
        if self.card.format != DIRECTED_FORMAT:
            inputs["budget"] = np.asarray(budget, dtype=np.float32)
        chunks = list[np.ndarray]()
        for start in range(0, max(len(rows), 1), CHUNK_ROWS):
            chunk = rows[start : start + CHUNK_ROWS]
            inputs[given] = self._padded(network, chunk)
            answer = self._run(session, network.answer, inputs)
            if answer.shape != (len(inputs[given]), network.answer_columns):
                expected = f"{network.answer} of {network.answer_columns} columns, a row for each"
                raise ModelError(self.name, expected=expected, found=f"shape {answer.shape}")
            chunks.append(answer[: len(chunk)])
        answers = chunks[0] if len(chunks) == 1 else np.concatenate(chunks)
        if not np.isfinite(answers).all():
            expected = f"finite numbers in {network.answer}"
            raise ModelError(self.name, expected=expected, found="NaN or infinity")
        return answers

    def _padded(
        self, network: Network, chunk: Float[np.ndarray, "N K"]
    ) -> Float32[np.ndarray, "M K"]:
        """Return a chunk in float32, padded to a multiple of ROW_MULTIPLE rows.

        What must be copied goes to an array of the calling thread: a new one for each chunk takes a
        quarter longer. Rows past the last of a chunk pad it, whatever they hold.
        """
        count = len(chunk)
        if count % ROW_MULTIPLE == 0 and chunk.dtype == np.float32 and chunk.flags.c_contiguous:
            return chunk
        kept: dict[str, np.ndarray] = vars(self._of_thread).setdefault("rows", {})
        if network.given not in kept:
            kept[network.given] = np.zeros((CHUNK_ROWS, network.columns), dtype=np.float32)
        rows = kept[network.given]
        rows[:count] = chunk
        return rows[: count + -count % ROW_MULTIPLE]

    def _run(self, session: Any, output: str, inputs: dict[str, np.ndarray]) -> np.ndarray:
        try:
            (answer,) = session.run([output], inputs)
        except Exception as error:  # onnxruntime's errors share no base below Exception
            raise ModelError(
                self.name, expected="a graph that runs to its end", found=first_line(error)
            ) from error
        return np.asarray(answer)

    def _session(self) -> Any:
        """Return the calling thread's session."""
        session = getattr(self._of_thread, "session", None)
        if session is None:
            session = self._of_thread.session = _open_session(self.data, self.name, self._wanted)
        return session


def onnx_runtime() -> Any:
    """Import onnxruntime, which reports its use to its makers unless it is told not to."""
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
    import onnxruntime  # pyright: ignore[reportMissingTypeStubs]  # lazy: half of the import time

    return onnxruntime


def _open_session(data: bytes, name: str, providers: Sequence[str]) -> Any:
    runtime = onnx_runtime()
    available = runtime.get_available_providers()
    if not providers or any(provider not in available for provider in providers):
        expected = f"some of {', '.join(available)}"
        raise ParameterError("providers", tuple(providers), expected=expected)
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    # What one run took is given back: its arena would keep the most that any has taken.
    options.enable_cpu_mem_arena = False
    options.enable_mem_pattern = False
    options.log_severity_level = 4
    try:
        return runtime.InferenceSession(data, options, providers=list(providers))
    except Exception as error:  # onnxruntime's errors share no base below Exception
        raise ModelError(
            name, expected="a graph that onnxruntime runs", found=first_line(error)
        ) from error


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, or its class without any."""
    return [*str(error).splitlines(), type(error).__name__][0]
