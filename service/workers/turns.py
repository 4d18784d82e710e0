"""Order of the jobs that wait for a worker.

Weighted fair queueing (Demers, Keshav and Shenker 1989), with a job's predicted seconds for a
packet's length: each client advances by what its jobs cost, and who has advanced least is next. So
a client with one small job passes one with many or large ones, and nobody waits for ever. Jobs that
are predicted to be short have a worker and slots to themselves besides: no large job is ever in
front of them.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from itertools import count

from ..errors import BusyError


class Lane(Enum):
    """Lanes: workers for any job, or the one for short ones."""

    ANY = "any"
    SHORT = "short"


@dataclass(eq=False, slots=True)
class Waiting:
    """A job that waits: whose, how long it will take, where it stands, its turn once it comes."""

    client: str
    seconds: float
    tag: tuple[float, int]
    counted: bool
    turn: asyncio.Future[Lane] = field(repr=False)

    @property
    def lane(self) -> Lane:
        """Lane of its turn, once it has come."""
        return self.turn.result()


class Turns:
    """Hands out turns on `workers` workers for any job and one for short jobs.

    Args:
        workers: how many jobs of any size run at the same time.
        slots: how many short ones may wait beside them, and how many others. One client may take
            three quarters of them, so that it alone never locks out the others.
        short_seconds: a job that is predicted to take no longer is short.
    """

    def __init__(self, workers: int, slots: int, short_seconds: float) -> None:
        self.short_seconds = short_seconds
        self.running: Counter[Lane] = Counter()
        self._workers = {Lane.ANY: workers, Lane.SHORT: 1}
        self._slots = slots
        self._waiting: list[Waiting] = []
        self._now = 0.0
        self._numbers = count()
        self._reached: dict[str, float] = {}
        self._running_seconds = 0.0

    @property
    def waiting(self) -> int:
        """Number of those that wait and take a slot."""
        return sum(job.counted for job in self._waiting)

    def backlog(self, before: Waiting | None = None, *, short: bool = False) -> float:
        """Predict the seconds until one that waits will run.

        None: until one that came last of all would, a `short` one or another.
        """
        if before is not None:
            if before.turn.done():
                return 0.0
            short = self._is_short(before.seconds)
        seconds = sum(job.seconds for job in self._ahead(before, short=short))
        return seconds if short else (seconds + self._running_seconds) / self._workers[Lane.ANY]

    def place_of(self, waiting: Waiting) -> int:
        """Count those that come before one that waits."""
        short = self._is_short(waiting.seconds)
        return sum(job.counted for job in self._ahead(waiting, short=short))

    def _ahead(self, before: Waiting | None, *, short: bool) -> list[Waiting]:
        """Return those in front of one that waits, or (None) all; no large one before a short."""
        return [
            job
            for job in self._waiting
            if (before is None or job.tag < before.tag)
            and (not short or self._is_short(job.seconds))
        ]

    def _is_short(self, seconds: float) -> bool:
        return seconds <= self.short_seconds

    async def come(self, waiting: Waiting) -> None:
        """Wait until its turn has come; `end` must follow. Cancelled, it leaves the line."""
        try:
            await waiting.turn
        except asyncio.CancelledError:
            self.leave(waiting)
            raise

    def join(self, client: str, seconds: float, *, counted: bool = True) -> Waiting:
        """Stand in line, from now on, with a job of so many predicted seconds.

        `come` or `leave` must follow.

        One that is not `counted` takes no slot: whoever sends it must be bounded otherwise.

        Raises:
            BusyError: no slot is free, or none for this client; `retry_after` is the backlog.
        """
        reached = max(self._now, self._reached.get(client, 0.0)) + seconds
        # Who came first of two that have advanced as far.
        tag = reached, next(self._numbers)
        waiting = Waiting(client, seconds, tag, counted, asyncio.get_running_loop().create_future())
        self._waiting.append(waiting)
        self._grant()
        if counted and not waiting.turn.done():
            self._waiting.remove(waiting)
            self.check_room(client, seconds)
            self._waiting.append(waiting)
        self._reached[client] = reached
        return waiting

    def check_room(self, client: str, seconds: float = 0.0) -> None:
        """Raise BusyError where a job of this client would have to wait and finds no slot."""
        short = self._is_short(seconds)
        if self._is_free(Lane.ANY) or (short and self._is_free(Lane.SHORT)):
            return
        rivals = [
            job for job in self._waiting if job.counted and self._is_short(job.seconds) == short
        ]
        if len(rivals) >= self._slots:
            raise self.busy(f"{len(rivals)} jobs wait; no more fit", short=short)
        mine = sum(job.client == client for job in rivals)
        if mine >= max(1, self._slots * 3 // 4):
            text = f"{mine} jobs of this client wait; no more of one client fit"
            raise self.busy(text, short=short)

    def _is_free(self, lane: Lane) -> bool:
        return self.running[lane] < self._workers[lane]

    def busy(self, detail: str, *, short: bool = False) -> BusyError:
        """Return the error for who finds no room, with the time until there may be some."""
        return BusyError(detail, retry_after=max(1, round(self.backlog(short=short) + 0.5)))

    def _grant(self) -> None:
        """Give every free worker to the first of those that it may run."""
        for lane, limit in (Lane.SHORT, self.short_seconds), (Lane.ANY, float("inf")):
            while self._is_free(lane):
                fitting = [
                    job for job in self._waiting if job.seconds <= limit and not job.turn.done()
                ]
                if not fitting:
                    break
                self._begin(min(fitting, key=lambda job: job.tag), lane)

    def _begin(self, first: Waiting, lane: Lane) -> None:
        self._waiting.remove(first)
        self.running[lane] += 1
        self._now = max(self._now, first.tag[0] - first.seconds)
        self._running_seconds += first.seconds if lane is Lane.ANY else 0
        first.turn.set_result(lane)
        # Who has been passed by all others is forgotten: a new client stands where it would.
        self._reached = {name: at for name, at in self._reached.items() if at > self._now}

    def leave(self, waiting: Waiting) -> None:
        """Stand in line no longer; the client's other jobs stand as if this had never come."""
        if waiting in self._waiting:
            self._waiting.remove(waiting)
            self._advance(waiting.client, -waiting.seconds, after=waiting)
        elif waiting.turn.done() and not waiting.turn.cancelled():
            # Its turn came in the same moment.
            self._advance(waiting.client, -waiting.seconds, after=waiting)
            self.end(waiting)

    def end(self, waiting: Waiting, spent: float = 0.0) -> None:
        """Give a turn back, to whoever is next; what it took beyond its prediction is paid for.

        `spent` is in predicted seconds. The client's other jobs stand as much further back.
        """
        over = max(spent - waiting.seconds, 0.0)
        if over:
            self._advance(waiting.client, over)
        self.running[waiting.lane] -= 1
        if waiting.lane is Lane.ANY:
            self._running_seconds = max(self._running_seconds - waiting.seconds, 0.0)
        self._grant()

    def _advance(self, client: str, seconds: float, *, after: Waiting | None = None) -> None:
        """Move a client, and its jobs that wait (behind another), back by so many seconds."""
        reached = max(self._now, self._reached.get(client, 0.0))
        self._reached[client] = reached + seconds
        for job in self._waiting:
            if job.client == client and (after is None or job.tag > after.tag):
                job.tag = job.tag[0] + seconds, job.tag[1]
