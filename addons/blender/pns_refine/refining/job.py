"""A computation in a thread of its own, that can be asked how far it is, and told to stop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Answer = TypeVar("Answer")


class StoppedError(Exception):
    """The computation was told to stop."""


class Job(Generic[Answer]):
    """Runs ``work(progress)`` in a thread; the work tells ``progress`` the share that is done.

    ``cancel`` makes the next such call raise, so the work stops where it next reports.
    """

    def __init__(self, work: Callable[[Callable[[float], None]], Answer]) -> None:
        self._work = work
        self._stop = threading.Event()
        self._answer: Answer | None = None
        self._error: BaseException | None = None
        self.share = 0.0
        self._thread = threading.Thread(target=self._run, name="pns-refine", daemon=True)

    def start(self) -> Job[Answer]:
        """Begin."""
        self._thread.start()
        return self

    @property
    def running(self) -> bool:
        """True until it is done or stopped."""
        return self._thread.is_alive()

    def cancel(self) -> None:
        """Ask it to stop; it does at its next report."""
        self._stop.set()

    def wait(self, seconds: float | None = None) -> None:
        """Wait until it has ended, or for so long."""
        self._thread.join(seconds)

    def answer(self) -> Answer:
        """Return what it came to.

        Raises:
            StoppedError: it was told to stop. Whatever the work raised, it raises too.
        """
        self.wait()
        if self._error is not None:
            raise self._error
        return self._answer  # type: ignore[return-value]

    def _run(self) -> None:
        try:
            self._answer = self._work(self._report)
            self.share = 1.0
        except BaseException as error:  # handed to whoever asks for the answer
            self._error = error

    def _report(self, share: float) -> None:
        if self._stop.is_set():
            raise StoppedError
        self.share = share
