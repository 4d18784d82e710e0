"""The desk: when jobs would start at once, and which are not worth waiting for."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

from service.errors import BusyError
from service.workers.budget import FacesBudget, OverBudgetError
from service.workers.costs import Cost
from service.workers.desk import Desk
from service.workers.job import State
from service.workers.jobs import Done, Work
from service.workers.memory_file import MemoryFile
from service.workers.pool import Workers
from service.workers.turns import Lane, Turns
from tests.service.workers.test_pool import run, workers
from tests.support import stand_in_jobs as jobs
from tests.support.handed_in import job_of


def desk_of(
    many: Workers,
    short: Workers,
    run: Callable[[Work], Done] = jobs.obey,
    short_seconds: float = 1.0,
) -> Desk:
    return Desk(
        {Lane.ANY: many, Lane.SHORT: short},
        Turns(1, 1, short_seconds),
        FacesBudget(),
        run=run,
        measure=jobs.measure,
        job_seconds=30,
    )


def test_ready_once_every_lane_has_warmed_up() -> None:
    """Each job is measured in the lane of short jobs first: the first one would wait for it."""

    async def scenario() -> None:
        async with workers() as many, workers(warm_up=jobs.refuse) as short:
            await asyncio.gather(many.run(jobs.nothing), short.run(jobs.nothing))
            assert many.ready
            assert not desk_of(many, short).ready
        async with workers() as many, workers() as short:
            desk = desk_of(many, short)
            await asyncio.gather(many.run(jobs.nothing), short.run(jobs.nothing))
            assert desk.ready

    run(scenario)


def test_a_killed_worker_of_the_short_lane_does_not_take_the_service_away() -> None:
    async def scenario() -> None:
        async with workers() as many, workers() as short:
            desk = desk_of(many, short)
            process = await short.run(jobs.pid)
            await many.run(jobs.nothing)
            os.kill(process, signal.SIGKILL)
            while short.ready:
                await asyncio.sleep(0.005)
            assert desk.ready

    run(scenario)


class AtOnce:
    """Workers that do what they are told where they are told."""

    async def run(
        self,
        function: Callable[[Work], Any],
        work: Work,
        taken: Callable[[], None] = lambda: None,
        **_: object,
    ) -> Any:
        taken()
        return function(work)


class Restarting(AtOnce):
    """Workers of which a job finds the only one dead: another is there after so long."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    async def run(self, *arguments: Any, **named: Any) -> Any:
        await asyncio.sleep(self._seconds)
        return await super().run(*arguments, **named)


def desk_with_a_line(seconds: float) -> Desk:
    """One whose workers are busy, with a job of so many seconds."""
    now = AtOnce()
    desk = desk_of(cast(Workers, now), cast(Workers, now), short_seconds=0.5)
    desk.turns.join("another", seconds)
    assert desk.running == 1
    return desk


async def refused(desk: Desk, seconds: float) -> BusyError:
    """Return the refusal of a job of a second that is to be done within so many."""
    with MemoryFile() as answer:
        job = job_of(b"", answer, seconds=seconds)
        with pytest.raises(BusyError) as refusal:
            await desk.serve(job)
        assert (job.state, job.error) == (State.FAILED, refusal.value)
        assert job.body.closed
    return refusal.value


def test_a_job_that_would_come_too_late_is_told_before_it_waits() -> None:
    async def scenario() -> None:
        desk = desk_with_a_line(100)
        told = await refused(desk, 60)
        assert "too long" in told.detail
        assert told.retry_after >= 100
        assert (desk.waiting, desk.running) == (0, 1)

    run(scenario)


def test_a_job_whose_turn_does_not_come_in_time_leaves_the_line() -> None:
    async def scenario() -> None:
        desk = desk_with_a_line(100)
        desk.turns.join("another", 0.5, counted=False)
        assert desk.running == 2
        assert "in time" in (await refused(desk, 0)).detail
        assert (desk.waiting, desk.running) == (0, 2)

    run(scenario)


def test_a_short_job_that_takes_long_goes_to_the_other_line(tmp_path: Path) -> None:
    """Whatever was predicted, the worker of the short jobs is soon free; and no worker dies."""

    async def scenario() -> None:
        async with workers() as many, workers() as short:
            desk = desk_of(many, short, run=jobs.stopped_once, short_seconds=0.01)
            first, other = await short.run(jobs.pid), await many.run(jobs.pid)
            with MemoryFile() as answer:
                await desk.serve(job := job_of(f"short {tmp_path}".encode(), answer))
                assert (tmp_path / "began").read_text() == str(first)
                assert b"".join(answer.pieces()) == str(other).encode()
            assert job.state is State.DONE
            assert await short.run(jobs.pid) == first

    run(scenario)


def test_a_job_that_no_worker_has_begun_is_free() -> None:
    """Refused, or given up while it waits: its client's faces are there for the next one."""

    async def scenario() -> None:
        desk = desk_with_a_line(10)
        per_minute = 4.0
        with MemoryFile() as answer:
            for seconds in (5, 60, 60):
                job = job_of(b"", answer, seconds=seconds)
                job.faces_per_minute = per_minute
                serving = asyncio.create_task(desk.serve(job))
                await job.accepted.wait()
                serving.cancel()
                told = await asyncio.gather(serving, return_exceptions=True)
                assert not isinstance(told[0], OverBudgetError)
            assert job.state is State.CANCELLED

    run(scenario)


@pytest.mark.parametrize(("most", "left"), [(True, 90), (False, 50)])
def test_of_the_most_that_may_come_what_did_not_is_given_back(most: bool, left: int) -> None:
    """Fewer faces than were counted are no credit: cleaning dropped them."""

    async def scenario() -> None:
        now, budget = cast(Workers, AtOnce()), FacesBudget()
        desk = Desk(
            {Lane.ANY: now, Lane.SHORT: now},
            Turns(1, 1, 1.0),
            budget,
            run=lambda work: Done({}, None, faces=10),
            measure=lambda work: Cost(50, 1, 0.01, most=most),
            job_seconds=30,
        )
        with MemoryFile() as answer:
            job = job_of(b"", answer)
            job.faces_per_minute = 100.0
            await desk.serve(job)
        with pytest.raises(OverBudgetError, match=f"{left} of 100"):
            budget.charge("a", 100, 100.0)

    run(scenario)


def test_nobody_pays_for_the_end_of_anothers_worker() -> None:
    async def scenario() -> None:
        now = Restarting(0.2)
        desk = desk_of(cast(Workers, now), cast(Workers, now), run=lambda work: Done({}, None))
        with MemoryFile() as answer:
            await desk.serve(job := job_of(b"short", answer))
        assert job.began is not None
        # It was measured, and predicted to take a hundredth of a second; twice that long it waited.
        assert desk.turns.join("a", 0.0).tag[0] < 0.2

    run(scenario)


def test_what_a_job_says_of_itself_keeps_nobody_waiting_for_longer_than_it_may_run() -> None:
    async def scenario() -> None:
        now, turns, predicted = cast(Workers, AtOnce()), Turns(1, 1, 1.0), list[float]()

        def begun(work: Work) -> Done:
            predicted.append(turns.backlog())
            return Done({}, None)

        desk = Desk(
            {Lane.ANY: now, Lane.SHORT: now},
            turns,
            FacesBudget(),
            run=begun,
            measure=lambda work: Cost(4, 1, 1e9),
            job_seconds=30,
        )
        with MemoryFile() as answer:
            await desk.serve(job_of(b"", answer))
        assert predicted == [30.0]

    run(scenario)
