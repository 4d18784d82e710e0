"""Admission: which requests are under way, whether new ones are taken, and how they are ended."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from dataclasses import dataclass

from ..errors import BusyError


class DrainingError(BusyError):
    """The service shuts down: it finishes what it has and takes nothing new."""

    code = "draining"
    title = "The service is shutting down"


class CutOffError(Exception):
    """A client was too slow to take its answer, and the memory is needed."""


class Admission:
    """Counts uploads, jobs and answers apart: who only sends or reads slowly keeps nobody waiting.

    Bodies and answers are memory, so their bytes are counted: `body_bytes` of all bodies, from
    their first piece to the end of their jobs, and `answer_bytes` of all answers.
    """

    def __init__(self, *, uploads: int, body_bytes: int, answer_bytes: int) -> None:
        # The service is to shut down, or has too many connections: then answers end theirs.
        self.leaving = self.crowded = False
        # Nothing new is taken.
        self.draining = False
        self._uploads = _Places("uploads", uploads)
        self._jobs = _Places("jobs", None)
        self._answers = _Shares(answer_bytes)
        self._bodies = _Shares(body_bytes)

    @property
    def admitted(self) -> int:
        """Requests and jobs under way."""
        return self._uploads.taken + self._jobs.taken

    @asynccontextmanager
    async def upload(self) -> AsyncIterator[None]:
        """Hold a slot while a body arrives.

        Raises:
            BusyError: no slot is free.
            DrainingError: the service shuts down, now or while the body arrives.
        """
        if self.draining:
            raise DrainingError("no new request is taken", retry_after=5)
        async with self._uploads.held():
            yield

    def working(self) -> AbstractAsyncContextManager[None]:
        """Be under way, until `end` says otherwise. Raises DrainingError."""
        return self._jobs.held()

    @asynccontextmanager
    async def answering(self, client: str, size: int) -> AsyncIterator[None]:
        """Hold an answer of so many bytes while a client takes it.

        Where memory runs short, the client whose answers hold the most loses its oldest.

        Raises:
            CutOffError: it was this one.
            BusyError: nobody who takes an answer holds as much as this client would.
        """
        with self._answers.share(client) as answer:
            if not answer.take(size, own_first=True):
                raise BusyError("the answers that others take leave no room for this one")
            async with answer.giving_way(CutOffError):
                yield

    @contextmanager
    def body(self, client: str) -> Iterator[Body]:
        """Keep account of a body, from before its first piece to the end of its job."""
        with self._bodies.share(client) as share:
            yield Body(share)

    def end_uploads(self) -> None:
        """End what still sends its body."""
        self._uploads.end()

    def end(self) -> None:
        """End everything that is under way."""
        self._uploads.end()
        self._jobs.end()


class Body:
    """Counts of one body."""

    def __init__(self, share: _Share) -> None:
        self._share = share

    def grow(self, size: int) -> None:
        """Count a piece before it is kept.

        Where memory runs short, the client whose bodies take the most loses the oldest of those
        that are still on their way, if it has more than this one would.

        Raises:
            BusyError: nobody has; or this client would hold more than three quarters of all, so
                that it alone never locks out others.
        """
        if not self._share.take(size, most=3 / 4):
            raise BusyError("the bodies that are held leave no room for this one")

    @asynccontextmanager
    async def arriving(self) -> AsyncIterator[None]:
        """Be on the way, and perhaps give way. Raises BusyError."""
        async with self._share.giving_way(_given_way):
            yield
        if self._share.told:
            # It was whole in the same moment: its bytes are another's already.
            raise _given_way()


def _given_way() -> BusyError:
    return BusyError("this body has given way to one of a client who holds less")


class _Shares:
    """Shares of so many bytes: what each client holds, and who of them may have to give way."""

    def __init__(self, room: int) -> None:
        self.room = room
        # By client; who holds nothing is not there.
        self.held: Counter[str] = Counter()
        # The oldest first.
        self.leaving: dict[_Share, asyncio.Timeout] = {}

    @contextmanager
    def share(self, client: str) -> Iterator[_Share]:
        share = _Share(client, self)
        try:
            yield share
        finally:
            share.give_back()


@dataclass(eq=False)
class _Share:
    client: str
    all: _Shares
    size: int = 0
    told: bool = False

    def take(self, size: int, *, most: float = 1.0, own_first: bool = False) -> bool:
        """Hold more bytes; return whether there is room, `most` of it for one client.

        Others give way whose client holds more than this one; or as much, with `own_first`, so that
        one without others is never too large.
        """
        held = self.all.held + Counter({self.client: size})
        if held[self.client] > most * self.all.room and not own_first:
            return False
        left = [other for other in self.all.leaving if other.size]
        gone: list[_Share] = []
        while held.total() > self.all.room and not (own_first and not left):
            greedier = [one for one in left if held[one.client] + own_first > held[self.client]]
            if not greedier:
                return False
            gone.append(max(greedier, key=lambda other: held[other.client]))
            left.remove(gone[-1])
            held[gone[-1].client] -= gone[-1].size
        for other in gone:
            other.told = True
            other.give_back()
            _tell(self.all.leaving.pop(other))
        self.all.held[self.client] += size
        self.size += size
        return True

    def give_back(self) -> None:
        self.all.held -= Counter({self.client: self.size})
        self.size = 0

    @asynccontextmanager
    async def giving_way(self, error: Callable[[], Exception]) -> AsyncIterator[None]:
        async with _until_told(error) as end:
            self.all.leaving[self] = end
            try:
                yield
            finally:
                self.all.leaving.pop(self, None)


class _Places:
    """Slots, a bounded number or (None) any, and those who would leave theirs when told to."""

    def __init__(self, name: str, count: int | None) -> None:
        self._name = name
        self._count = count
        self._ends: set[asyncio.Timeout] = set()
        self.taken = 0

    @asynccontextmanager
    async def held(self) -> AsyncIterator[None]:
        if self._count is not None and self.taken >= self._count:
            raise BusyError(f"{self.taken} {self._name} are under way; no more fit")
        self.taken += 1
        try:
            async with _until_told(_ended) as end:
                self._ends.add(end)
                try:
                    yield
                finally:
                    self._ends.discard(end)
        finally:
            self.taken -= 1

    def end(self) -> None:
        while self._ends:
            _tell(self._ends.pop())


def _ended() -> DrainingError:
    return DrainingError("the request was ended", retry_after=5)


@asynccontextmanager
async def _until_told(error: Callable[[], Exception]) -> AsyncIterator[asyncio.Timeout]:
    """Yield what `_tell` ends this by, with an error of its own."""
    end = asyncio.timeout(None)
    try:
        async with end:
            yield end
    except TimeoutError as ended:
        if not end.expired():
            raise
        raise error() from ended


def _tell(end: asyncio.Timeout) -> None:
    end.reschedule(asyncio.get_running_loop().time())
