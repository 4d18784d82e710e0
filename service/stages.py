"""Progress of the work on a file: its stage, the share that is done, seconds by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock


def _nobody_listens(_: object) -> None:
    pass


@dataclass
class Stages:
    """Told by the work, from any of its threads; tells whoever waits for it.

    Work is made of parts, and these of parts; each knows only the share of its own that is done.

    Attributes:
        begins: called with the name of each stage as it begins.
        moves: called with the share of the whole that is done, 0 … 1, which never goes back. What
            either of them raises ends the work.
        seconds: how long each stage has taken, all of its parts together.
    """

    begins: Callable[[str], None] = _nobody_listens
    moves: Callable[[float], None] = _nobody_listens
    seconds: dict[str, float] = field(default_factory=dict)
    _done: float = 0.0
    _start: float = 0.0
    _length: float = 1.0
    _lock: Lock = field(default_factory=Lock, repr=False)

    @contextmanager
    def stage(self, name: str, start: float = 0.0, end: float = 1.0) -> Iterator[None]:
        """Go through a stage, from one share of the part around it to another."""
        self.begins(name)
        began = time.perf_counter()
        with self.part(start, end):
            yield
        self.book(name, time.perf_counter() - began)

    @contextmanager
    def part(self, start: float, end: float) -> Iterator[None]:
        """Go from one share of the part around it to another; shares inside are the part's own."""
        outer = self._start, self._length
        self._start, self._length = outer[0] + outer[1] * start, outer[1] * (end - start)
        try:
            self.reach(0.0)
            yield
            self.reach(1.0)
        finally:
            self._start, self._length = outer

    def reach(self, share: float) -> None:
        """Take note that so much of the part is done."""
        with self._lock:
            self._done = max(self._done, self._start + self._length * share)
            self.moves(min(self._done, 1.0))

    def count(self, total: int) -> Callable[[int], None]:
        """Return what counts the part's rows, as they are begun."""
        done = 0

        def more(rows: int) -> None:
            nonlocal done
            self.reach(min(done / total, 1.0) if total else 0.0)
            done += rows

        return more

    def book(self, stage: str, seconds: float) -> None:
        """Take note that a part of a stage took so long."""
        self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds
