"""Work on tasks, for every engine.

An engine takes tasks as they come and gives results as they end, in any order: those that came
together in one list. It holds a bounded number of tasks at a time. A task whose process died or
hung is tried again, elsewhere.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from ...errors import JobTimeout, ServiceError, WorkerDied

# A task that its worker does not survive twice is taken to be the cause.
MOST_ATTEMPTS = 2
# What is lost at most where a driver is killed, and how long an idle worker waits at the end.
SECONDS = 0.5
MOST = 256
# Before it is known how long a task takes.
FIRST = 1


T = TypeVar("T")
R = TypeVar("R")
Engine = Callable[[Iterator[T]], Iterator[list[R]]]


def nothing() -> None:
    """Do what a worker does beforehand where there is nothing to prepare."""


@dataclass(frozen=True)
class Work(Generic[T, R]):
    """Work on each task: a frozen dataclass whose `attempt` says how often it is tried, from 1 on.

    Attributes:
        job: done in a worker; what it raises is raised by the engine.
        lost: what a task gives whose workers died or hung each time; it may raise too.
        seconds: how long one try may take; None: any time.
        prepare: done by a new process on this machine, before the first task's time begins.
    """

    job: Callable[[T], R]
    lost: Callable[[T, ServiceError], R]
    seconds: float | None
    prepare: Callable[[], None] = nothing

    def again(self, task: T) -> T | None:
        """Return a task whose worker is lost, to be tried once more; None if tried enough."""
        tried: Any = task
        if tried.attempt >= MOST_ATTEMPTS:
            return None
        return replace(tried, attempt=tried.attempt + 1)

    def given_up(self, task: T, *, late: bool) -> R:
        """Return what a task gives whose last worker died, or hung, as far as is known."""
        if late:
            return self.lost(
                task, JobTimeout(f"it ran longer than {self.seconds:g} seconds, twice")
            )
        longer = "" if self.seconds is None else f", or longer than {self.seconds:g} seconds"
        text = f"its worker ended, twice: out of memory, a fault{longer}"
        return self.lost(task, WorkerDied(text))


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
