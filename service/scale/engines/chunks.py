"""Tasks that cross to a worker together: small ones would take less time than their messages."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

# What is lost at most where a driver is killed, and how long an idle worker waits at the end.
SECONDS = 0.5
MOST = 256
# Before it is known how long a task takes.
FIRST = 1


@dataclass(frozen=True)
class Done(Generic[R]):
    """The results of the first tasks of a chunk, and what they took; the others were not begun."""

    results: list[R]
    seconds: float

    @property
    def next_size(self) -> int:
        """Number of tasks like these that fill a chunk."""
        return max(1, min(MOST, int(len(self.results) * SECONDS / max(self.seconds, 1e-9))))


def do(
    job: Callable[[T], R],
    tasks: Sequence[T],
    seconds: float | None,
    begins: Callable[[int | None], None] = lambda _: None,
) -> Done[R]:
    """Do tasks in their order until a chunk's time is over; the first one in any case.

    Each may take so many ``seconds``: it is the end of its process else. ``begins`` is told which
    one begins, and None after each.
    """
    began = time.perf_counter()
    results: list[R] = []
    for number, task in enumerate(tasks):
        begins(number)
        with _ended_after(seconds):
            results.append(job(task))
        begins(None)
        if time.perf_counter() - began > SECONDS:
            break
    return Done(results, time.perf_counter() - began)


@contextmanager
def _ended_after(seconds: float | None) -> Iterator[None]:
    """End this process past a time, even while a job holds the interpreter."""
    if seconds is None:
        yield
        return
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
