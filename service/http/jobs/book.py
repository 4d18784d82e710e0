"""The jobs that their clients may come back for, and the disk space of their results."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

from ...errors import BusyError, ServiceError
from ...workers.job import Job, State
from .room import Kept, Room


class NoSuchJobError(ServiceError):
    """There is no job of that id: never was, or its time is over, or it is another client's."""

    status = 404
    code = "no-such-job"
    title = "There is no such job"


class NotDoneError(ServiceError):
    """The job has no result: it has not ended yet, or it was cancelled."""

    status = 409
    code = "job-not-done"
    title = "The job has no result"


@dataclass(eq=False, slots=True)
class Entry:
    """A job in the book.

    Attributes:
        owner: whose it is; None for everybody who knows its id.
        networks: what it counts for: its client, and the wider networks of its address.
        size: bytes of its result; None before its end.
        adopted: whether another replica of the service took it in.
        cancelled: whether its client has cancelled it.
        promised_until: on the clock of `time.monotonic`; until then it stays, whoever needs room.
    """

    job: Job
    owner: str | None
    networks: tuple[str, ...]
    task: asyncio.Task[None] | None = None
    end: asyncio.TimerHandle | None = None
    size: int | None = None
    promised_until: float = 0.0
    adopted: bool = False
    cancelled: bool = False


class JobBook:
    """Keeps jobs for `seconds` after their end, at most `max_jobs`, their results in `max_bytes`.

    A result that nobody has fetched stays for `promised_seconds`. Where one more does not fit,
    jobs are struck out in this order: those without a result, those that were fetched, then the
    oldest of the client that holds the most. What is promised stays, and the new result is refused;
    no client fills more than its share of the room with promises.
    """

    def __init__(
        self, *, seconds: float, promised_seconds: float, max_bytes: int, max_jobs: int
    ) -> None:
        self._seconds = seconds
        self._promised_seconds = promised_seconds
        self._room = Room(max_bytes, max_jobs)
        self._entries: dict[str, Entry] = {}
        # Those that have ended, in that order.
        self._ended: dict[str, Entry] = {}

    @property
    def bytes(self) -> int:
        """Bytes of all results."""
        return sum(entry.size or 0 for entry in self._ended.values())

    @property
    def tasks(self) -> list[asyncio.Task[None]]:
        """Tasks that work for a job in the book."""
        return [entry.task for entry in self._entries.values() if entry.task is not None]

    def check_room(self, networks: tuple[str, ...]) -> None:
        """Raise BusyError where a result of this client would find no place now."""
        self._room.check(self._kept().values(), networks)

    def add(self, job: Job, owner: str | None, networks: tuple[str, ...] = ()) -> Entry:
        """Write a job down."""
        entry = self._entries[job.id] = Entry(job, owner, networks or (job.client,))
        return entry

    def has(self, job_id: str) -> bool:
        """Return whether a job is in the book, whoever may see it."""
        return job_id in self._entries

    def find(self, job_id: str, client: str) -> Entry:
        """Return the entry of a job that this client may see. Raises NoSuchJobError."""
        entry = self._entries.get(job_id)
        if entry is None or entry.owner not in (None, client):
            raise NoSuchJobError("no job has this id, or its result is no longer kept")
        return entry

    def keep(self, job: Job) -> None:
        """Keep a job that has ended: make room for its result, and forget it in time.

        A job whose result finds no room has failed.
        """
        entry = self._entries.get(job.id)
        if entry is None:
            _release(job)
            return
        size = sum(file.size for file in job.results) if job.state is State.DONE else 0
        try:
            for name in self._room.leaving(self._kept(), entry.networks, size):
                self.forget(name)
        except BusyError as error:
            job.state, job.error, size = State.FAILED, error, 0
        if job.state is not State.DONE:
            _release(job)
        entry.size = size
        entry.promised_until = time.monotonic() + self._promised_seconds
        entry.end = asyncio.get_running_loop().call_later(self._seconds, self.forget, job.id)
        self._ended[job.id] = entry

    def hand_over(self, job: Job) -> None:
        """Forget a job whose result lies elsewhere, and let go of its files here."""
        self._entries.pop(job.id, None)
        _release(job)

    def forget(self, job_id: str) -> None:
        """Strike a job out, with its result; one that is not there is no error."""
        entry = self._entries.pop(job_id, None)
        if entry is not None:
            if entry.end is not None:
                entry.end.cancel()
            if self._ended.pop(job_id, None) is not None and entry.job.state is State.DONE:
                _release(entry.job)
            if entry.task is not None:
                # Also one that only waits for somebody to fetch the result.
                entry.task.cancel()

    async def close(self) -> None:
        """End all jobs and forget them."""
        tasks = self.tasks
        for job_id in list(self._entries):
            self.forget(job_id)
        await asyncio.gather(*tasks, return_exceptions=True)

    def _kept(self) -> dict[str, Kept]:
        """Return those that have ended, the oldest first."""
        now = time.monotonic()
        kept = {}
        for name, entry in self._ended.items():
            done, fetched = entry.job.state is State.DONE, entry.job.fetched.is_set()
            promised = done and not fetched and now < entry.promised_until
            kept[name] = Kept(entry.networks, entry.size or 0, done, fetched, promised)
        return kept


def _release(job: Job) -> None:
    for file in job.results:
        file.release()
