"""Admission: how many requests may be under way, and whether new ones are still taken."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from service.errors import BusyError


class DrainingError(BusyError):
    """The service shuts down: it finishes what it has and takes nothing new."""

    code = "draining"
    title = "The service is shutting down"


class Gate:
    """Counts the requests under way, from before their body is read until their answer is sent."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.admitted = 0
        self.draining = False

    @contextmanager
    def admit(self) -> Iterator[None]:
        """Hold one place. Raises BusyError where none is free, or where the service shuts down."""
        if self.draining:
            raise DrainingError("no new request is taken", retry_after=5)
        if self.admitted >= self.capacity:
            raise BusyError(f"{self.admitted} requests are under way; no more fit")
        self.admitted += 1
        try:
            yield
        finally:
            self.admitted -= 1
