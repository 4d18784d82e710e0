"""A job as the server knows it, from its admission to its end."""

from __future__ import annotations

import asyncio
import secrets
import time
from dataclasses import dataclass, field
from enum import StrEnum

from .costs import Cost
from .jobs import Done, Work
from .memory_file import MemoryFile
from .progress import ProgressPage
from .turns import Waiting


class State(StrEnum):
    """State of a job."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def ended(self) -> bool:
        """True for states that are final."""
        return self in (State.DONE, State.FAILED, State.CANCELLED)


@dataclass(eq=False)
class Job:
    """A job.

    Attributes:
        client: whose it is, for turns and budgets.
        faces_per_minute: that client's budget; None: no limit.
        work: what the worker is told.
        body: what was sent; let go once the job has ended.
        answer, report: what the worker fills; whoever made the job lets go of them.
        page: how far it is.
        upload_seconds: how long the body took to arrive.
        must_end: on the clock of `time.monotonic`; a job that ends later is none.
        id: nobody guesses it.
        admitted: when the body was there, on the same clock.
        cost: the prediction, once there is one.
        waiting: its place in line, once it has one.
        began: when a worker took it.
        error: why it failed.
        accepted: set once it stands in line, or has ended.
        ended: set at the end.
        fetched: set once the result was sent to somebody, whole.
    """

    client: str
    faces_per_minute: float | None
    work: Work
    body: MemoryFile
    answer: MemoryFile | None
    report: MemoryFile | None
    page: ProgressPage
    upload_seconds: float
    must_end: float
    id: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    admitted: float = field(default_factory=time.monotonic)
    state: State = State.QUEUED
    cost: Cost | None = None
    waiting: Waiting | None = None
    began: float | None = None
    done: Done | None = None
    error: Exception | None = None
    accepted: asyncio.Event = field(default_factory=asyncio.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    fetched: asyncio.Event = field(default_factory=asyncio.Event)
    closed: bool = False

    def close(self) -> None:
        """Close the body and the page, once; what the page says last stays."""
        if not self.closed:
            self.closed = True
            self.body.release()
            self.page.close()

    @property
    def files(self) -> list[MemoryFile]:
        """All files that the worker is told of."""
        return [self.body, self.page.file, *self.results]

    @property
    def results(self) -> list[MemoryFile]:
        """The files that the worker fills."""
        return [file for file in (self.answer, self.report) if file is not None]

    @property
    def share(self) -> float:
        """Share of the work that is done, 0 … 1."""
        return 1.0 if self.state is State.DONE else self.page.share

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds of each stage that there has been, from the first byte of the body."""
        before = {"upload": self.upload_seconds}
        if self.began is not None:
            before["queue"] = self.began - self.admitted
        return before | ({} if self.done is None else self.done.seconds)
