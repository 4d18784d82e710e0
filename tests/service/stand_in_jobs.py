"""Jobs for the service's tests: each does one thing that a real job may do to its worker.

The request's body says what to do, so that one pool of workers serves all tests.
"""

from __future__ import annotations

import os
import re
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pns_common import onnx_model
from pns_common.model_card import ModelCard
from pns_common.schemes import Model
from service import memory_file
from service.errors import GltfError, LimitError, NoModelError, UnreadableError
from service.jobs import Done, Work, warm_up

ZERO_CARD = ModelCard(1, "paper-5", 10.0, 0.5, "first-face", {}, {})


@dataclass(frozen=True)
class ZeroModel:
    """A model that corrects nothing, and crosses to the workers by pickling."""

    card: ModelCard = ZERO_CARD
    name: str = "zero"
    hash: str = "0" * 64

    def __call__(self, features: np.ndarray, budget: float) -> np.ndarray:
        return np.zeros((len(features), 3))


class CountedModel(ZeroModel):
    """A model that counts how often it is sent somewhere; it arrives as a ZeroModel."""

    pickled = 0

    def __reduce__(self) -> tuple[object, ...]:
        CountedModel.pickled += 1
        return (ZeroModel, ())


def no_warm_up(model: object) -> None:
    pass


def warm_up_among(folder: str, model: Model | str | None) -> None:
    """The real warm-up, in a package whose bundled files are those of another folder."""
    onnx_model.BUNDLED = Path(folder)
    warm_up(model)


def stay_away(seconds: float, model: object) -> None:
    """A warm-up that does not come to its end."""
    time.sleep(seconds)


def fails_to_warm_up(model: object) -> None:
    raise RuntimeError("no such thing")


def obey(work: Work) -> Done:
    """`sleep 2`, `die`, `hold`, … as the body says; anything else is echoed."""
    body = Path(work.body).read_bytes()
    word, _, argument = body[:100].decode(errors="replace").partition(" ")
    match word:
        case "sleep":
            time.sleep(float(argument))
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hold":
            # One long match in C: the interpreter lock is not released, and no signal handler runs.
            re.match(r"(a+)+$", "a" * 40 + "b")
        case "fault":
            raise ZeroDivisionError("secret detail")
        case "unpicklable":
            raise UnpicklableError(lambda: None)
        case "unreadable":
            raise UnreadableError("not a GLB")
        case "broken":
            raise GltfError("accessor 3 is too short", pointer="/accessors/3/count")
        case "faces":
            raise LimitError("too many faces", limit="faces", allowed=5, found=20)
        case "large":
            memory_file.write(work.answer, bytes(int(argument)))
            return Done({}, None)
        case "pid":
            body = str(os.getpid()).encode()
    memory_file.write(work.answer, body)
    return Done({"read": 0.001, "refine": 0.002}, None)


class UnpicklableError(Exception):
    pass


def sleep(seconds: float) -> str:
    time.sleep(seconds)
    return "slept"


def pid() -> int:
    return os.getpid()


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def hold() -> None:
    re.match(r"(a+)+$", "a" * 40 + "b")


def fault() -> None:
    raise UnpicklableError(lambda: None)


def refuse() -> None:
    raise GltfError("no", pointer="/meshes/0")


def nothing() -> None:
    pass


def needs(path: str) -> None:
    if not Path(path).exists():
        raise NoModelError(f"no {path}")
