"""Progress of a job, in memory that its worker writes and the server reads.

Nothing is sent, so nothing waits: a worker inside one long numpy call and a server with a thousand
clients hinder each other in nothing. The other way round it carries one word: to stop.
"""

from __future__ import annotations

import multiprocessing
from contextvars import ContextVar

from ..errors import ServiceError

STAGES = ("read", "weld", "refine", "attributes", "write")

_SCALE = 10**9
# Which word is what; the stage is a number into STAGES, plus one, and the share a whole number.
_STAGE, _DONE, _STOP = range(3)


class JobStopped(ServiceError):  # noqa: N818
    """Nobody wants the job any more: it ended itself when it was asked to."""

    status = 499
    code = "job-stopped"
    title = "The job was stopped"


class Progress:
    """Progress of a worker process in its job; the process is given it when it starts."""

    def __init__(self) -> None:
        self._words = multiprocessing.get_context("spawn").RawArray("q", 3)

    def clear(self) -> None:
        """Forget the job before."""
        self._words[:] = [0, 0, 0]

    @property
    def stage(self) -> str | None:
        """Stage of the worker; None before it begins."""
        number = self._words[_STAGE]
        return STAGES[number - 1] if 1 <= number <= len(STAGES) else None

    @property
    def share(self) -> float:
        """Share of the job that is done, 0 … 1."""
        return min(max(self._words[_DONE] / _SCALE, 0.0), 1.0)

    def stop(self) -> None:
        """Ask the worker to end the job where it next reports."""
        self._words[_STOP] = 1

    def begin(self, stage: str) -> None:
        """Begin a stage. Raises JobStopped."""
        self._report(_STAGE, 1 + STAGES.index(stage))

    def reach(self, share: float) -> None:
        """Take note that so much of the job is done, 0 … 1. Raises JobStopped."""
        self._report(_DONE, round(share * _SCALE))

    def _report(self, word: int, value: int) -> None:
        if self._words[_STOP]:
            raise JobStopped("the job was stopped")
        self._words[word] = value


# That of this process, in a worker.
PROGRESS: ContextVar[Progress] = ContextVar("progress")
