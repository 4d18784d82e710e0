"""The one way that a job takes: measured, charged, in line, run."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

from ..errors import ServiceError
from .budget import FacesBudget
from .costs import Cost, Slowness
from .job import Job, State
from .jobs import Done, Work
from .pool import Workers
from .progress import JobStopped
from .turns import Lane, Turns, Waiting
from .worker import JobFaultError

T = TypeVar("T")

# A job in the lane of short ones that takes so many times as long as a short one may is none: it is
# stopped, and stands in line again with the others.
OVERDUE = 10.0
# What measuring is counted as: the glance of a worker at a document.
MEASURING_SECONDS = 0.005


@dataclass(eq=False, slots=True)
class _Turn:
    """A turn on one of a lane's workers: when it took the job, and for how long it had it.

    It may still be another's for a while, who has left, or be started in the place of one that
    died: nobody pays for that.
    """

    lane: Lane
    began: float | None = None
    spent: float = 0.0

    def end(self) -> None:
        if self.began is not None:
            self.spent = time.monotonic() - self.began


class Desk:
    """Take jobs in.

    Args:
        workers: those for any job, and the one for short jobs.
        turns: who is next.
        budget: what each client may still ask for.
        run, measure: what a worker calls for a job, and to measure it.
        job_seconds: how long a job may run.
    """

    def __init__(
        self,
        workers: dict[Lane, Workers],
        turns: Turns,
        budget: FacesBudget,
        run: Callable[[Work], Done],
        measure: Callable[[Work], Cost],
        job_seconds: float,
    ) -> None:
        self.turns = turns
        self.watchers: list[Callable[[Job], None]] = []
        self._workers = workers
        self._budget = budget
        self._run = run
        self._measure = measure
        self._job_seconds = job_seconds
        self._slowness = Slowness()

    @property
    def ready(self) -> bool:
        """True where a job would start at once: all lanes are warm, and one for any job lives.

        The lane of short jobs measures each job first. Once warm, it is back within seconds
        whatever kills its worker; that must not take the service out of a cluster.
        """
        pools = self._workers.values()
        return all(pool.warmed for pool in pools) and self._workers[Lane.ANY].ready

    @property
    def restarts(self) -> Counter[str]:
        """Number of replaced workers, by cause."""
        return sum((workers.restarts for workers in self._workers.values()), Counter())

    @property
    def waiting(self) -> int:
        """Number of jobs that wait."""
        return self.turns.waiting

    @property
    def running(self) -> int:
        """Number of jobs that run or are measured."""
        return self.turns.running.total()

    async def serve(self, job: Job) -> None:
        """Take a job to its end. Cancelling this call ends the job.

        Raises:
            ServiceError: it failed; JobFaultError: by a fault of ours.
        """
        try:
            await self._serve(job)
            job.state = State.DONE
        except (ServiceError, JobFaultError) as error:
            job.state, job.error = State.FAILED, error
            raise
        finally:
            if not job.state.ended:
                job.state = State.CANCELLED
            job.close()
            job.accepted.set()
            job.ended.set()
            for watcher in self.watchers:
                watcher(job)

    def place(self, job: Job) -> int:
        """Count the jobs that come before one that waits."""
        return self.turns.waiting if job.waiting is None else self.turns.place_of(job.waiting)

    def remaining(self, job: Job) -> float | None:
        """Predict the seconds until a job ends; None where that is not known."""
        if job.state.ended:
            return 0.0
        if job.cost is None:
            return None
        predicted = job.cost.seconds * self._slowness.factor
        if job.began is None:
            return self._wait(job.waiting) + predicted
        spent = time.monotonic() - job.began
        if job.share > 0.05:
            return spent * (1 - job.share) / job.share
        return max(predicted - spent, 0.0)

    async def _serve(self, job: Job) -> None:
        waiting = self.turns.join(job.client, MEASURING_SECONDS, counted=False)
        async with self._turn(waiting, job) as turn:
            cost = await self._call(turn, job, self._measure)
        # None runs longer, whatever it says of itself: nobody else is to wait for that.
        most = self._job_seconds / self._slowness.factor
        cost = job.cost = replace(cost, seconds=min(cost.seconds, most))
        try:
            with self._paid(job, cost):
                job.waiting = self.turns.join(job.client, cost.seconds)
                if time.monotonic() + self._wait(job.waiting) > job.must_end:
                    self.turns.leave(job.waiting)
                    raise self.turns.busy("the jobs in front of this one will take too long")
                job.accepted.set()
                await self._run_in_turn(job, job.waiting)
        except JobStopped:
            # Who waits for a job does not stop it: it was overdue.
            job.page.go_on()
            job.began, job.state = None, State.QUEUED
            job.cost = replace(job.cost, seconds=OVERDUE * self.turns.short_seconds)
            job.waiting = self.turns.join(job.client, job.cost.seconds)
            await self._run_in_turn(job, job.waiting)

    @contextmanager
    def _paid(self, job: Job, cost: Cost) -> Iterator[None]:
        """Charge a job to its client; one that is refused or given up before it runs is free.

        Raises OverBudgetError.
        """
        self._budget.charge(job.client, cost.faces, job.faces_per_minute)
        try:
            yield
        finally:
            if job.began is None:
                self._budget.settle(job.client, -cost.faces, job.faces_per_minute)

    async def _run_in_turn(self, job: Job, waiting: Waiting) -> None:
        """Run a job in its turn. Raises JobStopped where a short job is overdue."""
        cost = job.cost
        async with self._turn(waiting, job) as turn:
            with self._overdue(turn.lane, job) as start_clock:

                def begin() -> None:
                    job.began, job.state = turn.began, State.RUNNING
                    start_clock()

                done = job.done = await self._call(turn, job, self._run, begin)
        if cost is not None:
            beyond = done.faces - cost.faces
            # Fewer than were counted are no credit: faces that cleaning dropped were work too.
            beyond = beyond if cost.most else max(beyond, 0)
            self._budget.settle(job.client, beyond, job.faces_per_minute)
            self._slowness.learn(cost.seconds, turn.spent)

    @contextmanager
    def _overdue(self, lane: Lane, job: Job) -> Iterator[Callable[[], None]]:
        """Yield what starts a job's clock: too long in the lane of short ones, it is stopped."""
        seconds = OVERDUE * self.turns.short_seconds * self._slowness.factor
        clock = asyncio.get_running_loop()
        timers: list[asyncio.TimerHandle] = []

        def start() -> None:
            if lane is Lane.SHORT:
                timers.append(clock.call_later(seconds, job.page.stop))

        try:
            yield start
        finally:
            for timer in timers:
                timer.cancel()

    @asynccontextmanager
    async def _turn(self, waiting: Waiting, job: Job) -> AsyncIterator[_Turn]:
        """Wait for a turn while the job may wait, and hold it. Raises BusyError."""
        try:
            async with asyncio.timeout(max(job.must_end - time.monotonic(), 0)):
                await self.turns.come(waiting)
        except TimeoutError as error:
            raise self.turns.busy("the job's turn did not come in time") from error
        turn = _Turn(waiting.lane)
        try:
            yield turn
        finally:
            turn.end()
            self.turns.end(waiting, turn.spent / self._slowness.factor)

    async def _call(
        self,
        turn: _Turn,
        job: Job,
        function: Callable[[Work], T],
        begin: Callable[[], None] = lambda: None,
    ) -> T:
        def taken() -> None:
            turn.began = time.monotonic()
            begin()

        must_end = min(job.must_end, time.monotonic() + self._job_seconds)
        return await self._workers[turn.lane].run(
            function,
            job.work,
            files=job.files,
            must_end=must_end,
            stop=job.page.stop,
            taken=taken,
        )

    def _wait(self, waiting: Waiting | None) -> float:
        return self.turns.backlog(waiting) * self._slowness.factor
