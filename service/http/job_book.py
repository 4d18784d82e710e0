"""The jobs that their clients may come back for, and the disk space of their results."""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass

from ..errors import ServiceError
from ..workers.job import Job, State


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
    """A job in the book, and whose it is: None for everybody who knows its id."""

    job: Job
    owner: str | None
    task: asyncio.Task[None] | None = None
    end: asyncio.TimerHandle | None = None


class JobBook:
    """Keeps jobs for `seconds` after their end, at most `max_jobs`, their results in `max_bytes`.

    Where one more does not fit, the client that holds the most loses its oldest: nobody can push
    out another's by asking for much. A job that failed or was cancelled is one of them: it takes no
    bytes, but nothing else would bound how many there are.
    """

    def __init__(self, *, seconds: float, max_bytes: int, max_jobs: int) -> None:
        self._seconds = seconds
        self._max_bytes = max_bytes
        self._max_jobs = max_jobs
        self._entries: dict[str, Entry] = {}
        # Of those that have ended, in that order.
        self._sizes: dict[str, int] = {}

    @property
    def bytes(self) -> int:
        """What the results take."""
        return sum(self._sizes.values())

    @property
    def tasks(self) -> list[asyncio.Task[None]]:
        """What still works for a job in the book."""
        return [entry.task for entry in self._entries.values() if entry.task is not None]

    def add(self, job: Job, owner: str | None) -> Entry:
        """Write a job down."""
        entry = self._entries[job.id] = Entry(job, owner)
        return entry

    def find(self, job_id: str, client: str) -> Entry:
        """Return the entry of a job that this client may see. Raises NoSuchJobError."""
        entry = self._entries.get(job_id)
        if entry is None or entry.owner not in (None, client):
            raise NoSuchJobError("no job has this id, or its result is no longer kept")
        return entry

    def keep(self, job: Job) -> None:
        """Keep a job that has ended: count its result, make room for it, forget it in time."""
        entry = self._entries.get(job.id)
        if entry is None or job.state is not State.DONE:
            _release(job)
        if entry is not None:
            done = job.state is State.DONE
            self._sizes[job.id] = sum(file.size for file in job.results) if done else 0
            entry.end = asyncio.get_running_loop().call_later(self._seconds, self.forget, job.id)
            self._make_room()

    def forget(self, job_id: str) -> None:
        """Strike a job out, with its result; one that is not there is no error."""
        entry = self._entries.pop(job_id, None)
        if entry is not None:
            if entry.end is not None:
                entry.end.cancel()
            if self._sizes.pop(job_id, None) is not None and entry.job.state is State.DONE:
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

    def _make_room(self) -> None:
        while self.bytes > self._max_bytes or len(self._sizes) > self._max_jobs:
            held: Counter[str] = Counter()
            for job_id, size in self._sizes.items():
                # Many small ones weigh too.
                held[self._entries[job_id].job.client] += size + self._max_bytes // self._max_jobs
            ((greediest, _),) = held.most_common(1)
            self.forget(
                next(key for key in self._sizes if self._entries[key].job.client == greediest)
            )


def _release(job: Job) -> None:
    for file in job.results:
        file.release()
