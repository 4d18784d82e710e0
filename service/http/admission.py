"""Admission: which requests are under way, whether new ones are taken, and how they are ended."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager

from ..errors import BusyError


class DrainingError(BusyError):
    """The service shuts down: it finishes what it has and takes nothing new."""

    code = "draining"
    title = "The service is shutting down"


class Admission:
    """Counts uploads, jobs and answers apart: who only sends or reads slowly keeps nobody waiting.

    Bodies and answers are memory, so their bytes are counted: `body_bytes` of all bodies, from
    their first piece to the end of their jobs, and `answer_bytes` of all answers.
    """

    def __init__(self, *, uploads: int, body_bytes: int, answer_bytes: int) -> None:
        self.draining = False
        self._uploads = _Places("uploads", uploads)
        self._jobs = _Places("jobs", None)
        self._answers = _Answers(answer_bytes)
        self._bodies = _Bodies(body_bytes)

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

    @asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """Be under way, until `end` says otherwise. Raises DrainingError."""
        async with self._jobs.held():
            yield

    @asynccontextmanager
    async def answering(self, client: str, size: int) -> AsyncIterator[None]:
        """Hold an answer of so many bytes while a client takes it.

        Where memory runs short, the client whose answers hold the most loses its oldest.

        Raises:
            CutOffError: it was this one.
            BusyError: nobody who takes an answer holds as much as this client would.
        """
        async with self._answers.held(client, size):
            yield

    @contextmanager
    def body(self, client: str) -> Iterator[Body]:
        """Keep account of a body, from before its first piece to the end of its job."""
        body = Body(client, self._bodies)
        try:
            yield body
        finally:
            self._bodies.forget(body)

    def end_uploads(self) -> None:
        """End what still sends its body."""
        self._uploads.end()

    def end(self) -> None:
        """End everything that is under way."""
        self._uploads.end()
        self._jobs.end()


class Body:
    """Counts of one body."""

    def __init__(self, client: str, bodies: _Bodies) -> None:
        self.client = client
        self.size = 0
        self._bodies = bodies

    def grow(self, size: int) -> None:
        """Count a piece before it is kept.

        Where memory runs short, the client whose bodies take the most loses the oldest of those
        that are still on their way, if it has more than this one would.

        Raises:
            BusyError: nobody has; or this client would hold more than three quarters of all, so
                that it alone never locks out others.
        """
        self._bodies.grow(self, size)

    @asynccontextmanager
    async def arriving(self) -> AsyncIterator[None]:
        """Be on the way, and perhaps give way. Raises BusyError."""
        async with self._bodies.arriving(self):
            yield


class _Bodies:
    """The bodies of all clients; who still sends may have to give way, a job's body never."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        # By client; who holds nothing is not there.
        self._held: Counter[str] = Counter()
        # The oldest first.
        self._arriving: dict[Body, asyncio.Timeout] = {}

    def grow(self, body: Body, size: int) -> None:
        mine = self._held[body.client] + size
        leaving = self._who_leaves(mine, size)
        if leaving is None or mine > self._max_bytes * 3 // 4:
            raise BusyError("the bodies that are held leave no room for this one")
        for other in leaving:
            _tell(self._arriving.pop(other))
            self.forget(other)
        self._held[body.client] += size
        body.size += size

    def _who_leaves(self, mine: int, size: int) -> list[Body] | None:
        """Return who gives way to one of `mine` bytes in all; None where that is not enough."""
        held = self._held.copy()
        leaving: list[Body] = []
        while held.total() + size > self._max_bytes:
            left = (other for other in self._arriving if other.size and other not in leaving)
            greedier = [other for other in left if held[other.client] > mine]
            if not greedier:
                return None
            leaving.append(max(greedier, key=lambda other: held[other.client]))
            held[leaving[-1].client] -= leaving[-1].size
        return leaving

    def forget(self, body: Body) -> None:
        self._held[body.client] -= body.size
        body.size = 0
        if not self._held[body.client]:
            del self._held[body.client]

    @asynccontextmanager
    async def arriving(self, body: Body) -> AsyncIterator[None]:
        try:
            async with _until_told(_given_way) as end:
                self._arriving[body] = end
                yield
        finally:
            told = self._arriving.pop(body, None) is None
        if told:
            # It was whole in the same moment: its bytes are another's already.
            raise _given_way()


def _given_way() -> BusyError:
    return BusyError("this body has given way to one of a client who holds less")


class CutOffError(Exception):
    """A client was too slow to take its answer, and the memory is needed."""


class _Answers:
    """The answers that are being taken, the oldest first: whose, and of how many bytes."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._taken: dict[asyncio.Timeout, tuple[str, int]] = {}

    @asynccontextmanager
    async def held(self, client: str, size: int) -> AsyncIterator[None]:
        self._make_room(client, size)
        async with _until_told(CutOffError) as end:
            self._taken[end] = client, size
            try:
                yield
            finally:
                self._taken.pop(end, None)

    def _make_room(self, client: str, size: int) -> None:
        held = Counter({client: size})
        for whose, own_size in self._taken.values():
            held[whose] += own_size
        left = dict(self._taken)
        while left and held.total() > self._max_bytes:
            most = max(held.values())
            greediest = (end for end, (whose, _) in left.items() if held[whose] == most)
            oldest = next(greediest, None)
            if oldest is None:
                raise BusyError("the answers that others take leave no room for this one")
            whose, own_size = left.pop(oldest)
            held[whose] -= own_size
        for end in self._taken.keys() - left.keys():
            _tell(end)
        self._taken = left


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
