"""Admission: which requests are under way, whether new ones are taken, and how they are ended."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager

from service.errors import BusyError


class DrainingError(BusyError):
    """The service shuts down: it finishes what it has and takes nothing new."""

    code = "draining"
    title = "The service is shutting down"


class Gate:
    """Counts uploads and jobs apart: who only sends slowly keeps nobody from being served.

    A request holds an upload's place while its body arrives, and a job's from then until its answer
    is sent. Bodies are memory, so their bytes are counted over both: `body_bytes` at most.
    """

    def __init__(self, *, jobs: int, uploads: int, body_bytes: int) -> None:
        self.draining = False
        self._jobs = _Places("jobs", jobs)
        self._uploads = _Places("uploads", uploads)
        self._free_bytes = body_bytes

    @property
    def admitted(self) -> int:
        """Requests under way."""
        return self._jobs.taken + self._uploads.taken

    @asynccontextmanager
    async def upload(self) -> AsyncIterator[None]:
        """Hold a place while a body arrives.

        Raises:
            BusyError: no place is free, or no job's: it would be sent for nothing.
            DrainingError: the service shuts down, now or while the body arrives.
        """
        if self.draining:
            raise DrainingError("no new request is taken", retry_after=5)
        self._jobs.check()
        with self._uploads.place():
            async with self._uploads.until_ended():
                yield

    @contextmanager
    def job(self) -> Iterator[None]:
        """Hold a place for a job and its answer. Raises BusyError."""
        with self._jobs.place():
            yield

    @asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """What a job's place is held for, until `end` says otherwise. Raises DrainingError."""
        async with self._jobs.until_ended():
            yield

    @contextmanager
    def body(self) -> Iterator[Callable[[int], None]]:
        """Keep account of a body: call the value before each piece. It raises BusyError."""
        held = 0

        def grow(size: int) -> None:
            nonlocal held
            if size > self._free_bytes:
                raise BusyError("the bodies of other requests leave no room for this one")
            self._free_bytes -= size
            held += size

        try:
            yield grow
        finally:
            self._free_bytes += held

    def end_uploads(self) -> None:
        """End what still sends its body."""
        self._uploads.end()

    def end(self) -> None:
        """End everything that is under way."""
        self._uploads.end()
        self._jobs.end()


class _Places:
    """A bounded number of places, and those who would leave theirs when told to."""

    def __init__(self, name: str, count: int) -> None:
        self._name = name
        self._count = count
        self._ends: set[asyncio.Timeout] = set()
        self.taken = 0

    def check(self) -> None:
        if self.taken >= self._count:
            raise BusyError(f"{self.taken} {self._name} are under way; no more fit")

    @contextmanager
    def place(self) -> Iterator[None]:
        self.check()
        self.taken += 1
        try:
            yield
        finally:
            self.taken -= 1

    @asynccontextmanager
    async def until_ended(self) -> AsyncIterator[None]:
        try:
            async with asyncio.timeout(None) as end:
                self._ends.add(end)
                try:
                    yield
                finally:
                    self._ends.discard(end)
        except TimeoutError as error:
            if not end.expired():
                raise
            raise DrainingError("the request was ended", retry_after=5) from error

    def end(self) -> None:
        now = asyncio.get_running_loop().time()
        while self._ends:
            self._ends.pop().reschedule(now)
