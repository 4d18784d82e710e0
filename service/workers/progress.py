"""Progress of a job, in a page of memory that its worker writes and the server reads.

Nothing is sent, so nothing waits: a worker inside one long numpy call and a server with a thousand
clients hinder each other in nothing. The other way round the page carries one word: to stop.
"""

from __future__ import annotations

import mmap
import os
from contextlib import ExitStack

from ..errors import NoStorageError, ServiceError
from . import memory_file
from .memory_file import FileName, MemoryFile

STAGES = ("read", "weld", "refine", "attributes", "write")

_SCALE = 10**9
_WORDS = 3
_SIZE = 8 * _WORDS
# Which word is what; the stage is a number into STAGES, plus one, and the share a whole number.
_STAGE, _DONE, _STOP = range(_WORDS)


class JobStopped(ServiceError):  # noqa: N818
    """Nobody wants the job any more: it ended itself when it was asked to."""

    status = 499
    code = "job-stopped"
    title = "The job was stopped"


class ProgressPage:
    """The server's side of the page. Raises NoStorageError where there is no room for one."""

    def __init__(self) -> None:
        with ExitStack() as held:
            self.file = held.enter_context(MemoryFile())
            self.file.append(bytes(_SIZE))
            try:
                self._map = mmap.mmap(self.file.descriptor, _SIZE)
            except OSError as error:
                raise NoStorageError(f"no page can be mapped: {error.strerror}") from error
            held.pop_all()
        self._words = memoryview(self._map).cast("q")

    def __enter__(self) -> ProgressPage:
        return self

    def __exit__(self, *_: object) -> None:
        self._words.release()
        self._map.close()
        self.file.close()

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
        """Ask the worker to end the job where it next looks."""
        self._words[_STOP] = 1


class Reporter:
    """The worker's side of the page, open until the end of a `with` block."""

    def __init__(self, name: FileName) -> None:
        descriptor = memory_file.opened(name, os.O_RDWR)
        try:
            self._map = mmap.mmap(descriptor, _SIZE)
        finally:
            os.close(descriptor)
        self._words = memoryview(self._map).cast("q")

    def __enter__(self) -> Reporter:
        return self

    def __exit__(self, *_: object) -> None:
        # A map has a descriptor of its own.
        self._words.release()
        self._map.close()

    def stage(self, name: str) -> None:
        """Begin a stage. Raises JobStopped."""
        self._check()
        self._words[_STAGE] = 1 + STAGES.index(name)

    def reach(self, share: float) -> None:
        """Take note that so much of the job is done, 0 … 1. Raises JobStopped."""
        self._check()
        self._words[_DONE] = round(share * _SCALE)

    def _check(self) -> None:
        if self._words[_STOP]:
            raise JobStopped("the job was stopped")
