"""Work on tasks, for every engine.

An engine takes tasks as they come and gives results as they end, in any order: those that came
together in one list. It holds a bounded number of tasks at a time. A task whose process died or
hung is tried again, elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from ...errors import JobTimeout, ServiceError, WorkerDied


class Attempted(Protocol):
    """A frozen dataclass that says how often it is tried now, from 1 on."""

    @property
    def attempt(self) -> int:
        """1, then 2 where the first worker died or hung, …"""
        ...


T = TypeVar("T", bound=Attempted)
R = TypeVar("R")
Engine = Callable[[Iterator[T]], Iterator[list[R]]]


def nothing() -> None:
    """Do what a worker does beforehand where there is nothing to prepare."""


@dataclass(frozen=True)
class Work(Generic[T, R]):
    """Work on each task.

    Attributes:
        job: done in a worker; what it raises is raised by the engine.
        lost: what a task gives whose workers died or hung each time; it may raise too.
        most_attempts: how often a task is tried.
        seconds: how long one try may take; None: any time.
        prepare: done by a new process on this machine, before the first task's time begins.
    """

    job: Callable[[T], R]
    lost: Callable[[T, ServiceError], R]
    most_attempts: int
    seconds: float | None
    prepare: Callable[[], None] = nothing

    def again(self, task: T) -> T | None:
        """Return a task whose worker is lost, to be tried once more; None if tried enough."""
        if task.attempt >= self.most_attempts:
            return None
        changed: Any = task
        return replace(changed, attempt=task.attempt + 1)

    def given_up(self, task: T, *, late: bool) -> R:
        """Return what a task gives whose last worker died, or hung, as far as is known."""
        times = "twice" if self.most_attempts == 2 else f"{self.most_attempts} times"
        if late:
            return self.lost(
                task, JobTimeout(f"it ran longer than {self.seconds:g} seconds, {times}")
            )
        longer = "" if self.seconds is None else f", or longer than {self.seconds:g} seconds"
        text = f"its worker ended, {times}: out of memory, a fault{longer}"
        return self.lost(task, WorkerDied(text))
