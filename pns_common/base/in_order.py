"""What several threads make, taken in one order: that of its numbers, whoever is done first."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")


class InOrder(Generic[T]):
    """Calls ``take`` for values number 0, 1, 2 …, one at a time, each as soon as it can be.

    Nobody waits: whoever puts the value that is next takes it and those after it that are there.
    """

    def __init__(self, take: Callable[[T], None]) -> None:
        self._take = take
        self._ready: dict[int, T] = {}
        self._next = 0
        self._taking = Lock()

    def put(self, number: int, value: T) -> None:
        """Hand in a value."""
        self._ready[number] = value
        # Asked again after each turn: one that came meanwhile was left to who had the turn.
        while self._next in self._ready:
            if not self._taking.acquire(blocking=False):
                return
            try:
                while self._next in self._ready:
                    self._take(self._ready.pop(self._next))
                    self._next += 1
            finally:
                self._taking.release()
