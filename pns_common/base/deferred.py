"""A value that is made when it is first asked for, by whichever thread asks."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")


class Deferred(Generic[T]):
    """A value made at most once; what it is made from is let go then."""

    def __init__(self, make: Callable[[], T]) -> None:
        self._make: Callable[[], T] | None = make
        self._made: list[T] = []
        self._lock = Lock()

    def __call__(self) -> T:
        """Return the value. Raises what making it raises, each time."""
        with self._lock:
            if self._make is not None:
                self._made = [self._make()]
                self._make = None
        return self._made[0]

    def __reduce__(self) -> tuple[type[_Made[T]], tuple[T]]:
        # What makes it cannot travel to another process; the value can.
        return _Made, (self(),)


class _Made(Deferred[T]):
    """A value that is there already."""

    def __init__(self, value: T) -> None:
        super().__init__(lambda: value)
