"""A computation in a thread of its own, that can be asked how far it is, and told to stop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Generic, TypeVar

Answer = TypeVar("Answer")


class StoppedError(Exception):
    """The computation was told to stop."""


class Job(Generic[Answer]):
    """Runs ``work(progress)`` in a thread; the work tells ``progress`` the share that is done."""

    def __init__(self, work: Callable[[Callable[[float], None]], Answer]) -> None:
        self._work, self._future = work, Future[Answer]()
        self._stop, self.share = threading.Event(), 0.0
        # A daemon, unlike those of executors: Blender need not wait for it to quit.
        threading.Thread(target=self._run, name="pns-refine", daemon=True).start()

    @property
    def running(self) -> bool:
        """True until it is done or stopped."""
        return not self._future.done()

    def cancel(self) -> None:
        """Ask it to stop; its next report raises."""
        self._stop.set()

    def answer(self) -> Answer:
        """Wait, and return what it came to.

        Raises:
            StoppedError: it was told to stop. Whatever the work raised, it raises too.
        """
        return self._future.result()

    def _run(self) -> None:
        try:
            answer = self._work(self._report)
            self.share = 1.0
            self._future.set_result(answer)
        except BaseException as error:  # handed to whoever asks for the answer
            self._future.set_exception(error)

    def _report(self, share: float) -> None:
        if self._stop.is_set():
            raise StoppedError
        self.share = share
