"""A model file run by onnxruntime; imported where it is installed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import onnxruntime  # pyright: ignore[reportMissingTypeStubs]

from pns_common.errors import ModelError
from pns_common.models.card import ModelCard
from pns_common.runtimes.model_check import check_file


class OnnxSession:
    """A checked file in a session of one thread."""

    def __init__(self, data: bytes, name: str):
        runtime: Any = onnxruntime  # ships no types
        options = runtime.SessionOptions()
        # The caller divides the work; one thread here keeps the bits the same everywhere.
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 4
        try:
            self._session = runtime.InferenceSession(
                data, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's errors share no base below Exception
            raise ModelError(
                name, expected="a graph that onnxruntime runs", found=str(error)
            ) from error

    def run(self, output: str, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return one output. Raises what onnxruntime raises."""
        (answer,) = self._session.run([output], dict(inputs))
        return np.asarray(answer)


def open_session(data: bytes, name: str) -> tuple[ModelCard, OnnxSession]:
    """Check the bytes of a model file; ``name`` is what errors call it.

    Raises:
        ModelError: the file breaks the contract; says which part.
    """
    return check_file(data, name), OnnxSession(data, name)
