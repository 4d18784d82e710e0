"""Workers: what happens to a job, to its neighbours and to the next one."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures.process import BrokenProcessPool
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

import pytest
from pebble import ProcessPool

from service.errors import BusyError, GltfError, JobTimeout, WorkerDied
from service.pool import Workers
from service.worker import JobFaultError
from tests.service import stand_in_jobs as jobs


@asynccontextmanager
async def workers(
    count: int = 1,
    seconds: float = 30,
    warm_up: Callable[[], object] = jobs.nothing,
) -> AsyncIterator[Workers]:
    pool = Workers(count, seconds, warm_up)
    pool.start()
    try:
        yield pool
    finally:
        await pool.stop()


def run(scenario: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), 60))


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_errors_cross_the_process_boundary_and_the_worker_lives_on() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            with pytest.raises(GltfError) as caught:
                await pool.run(jobs.refuse)
            assert caught.value.pointer == "/meshes/0"
            with pytest.raises(JobFaultError, match="UnpicklableError"):
                await pool.run(jobs.fault)
            assert await pool.run(jobs.pid) == first
            assert first != os.getpid()

    run(scenario)


def test_a_job_past_its_deadline_is_killed_even_while_it_holds_the_interpreter() -> None:
    async def scenario() -> None:
        # Its successor has to start within the same time.
        async with workers(seconds=2) as pool:
            first = await pool.run(jobs.pid)
            began = time.monotonic()
            with pytest.raises(JobTimeout):
                await pool.run(jobs.hold)
            assert time.monotonic() - began < 10
            assert await pool.run(jobs.pid) != first
            assert not alive(first)

    run(scenario)


def test_a_dying_worker_takes_only_its_own_job() -> None:
    async def scenario() -> None:
        async with workers(count=2) as pool:
            neighbour = asyncio.create_task(pool.run(jobs.sleep, 1.5))
            with pytest.raises(WorkerDied):
                await pool.run(jobs.die)
            assert await neighbour == "slept"
            assert await asyncio.gather(*(pool.run(jobs.sleep, 0.0) for _ in range(4)))

    run(scenario)


def test_a_worker_that_dies_idle_is_replaced() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            os.kill(first, signal.SIGKILL)
            while alive(first):
                await asyncio.sleep(0.05)
            await asyncio.sleep(0.3)
            assert await pool.run(jobs.pid) != first

    run(scenario)


def test_cancelling_kills_the_job_and_frees_its_place() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            held = asyncio.create_task(pool.run(jobs.hold))
            await asyncio.sleep(0.3)
            held.cancel()
            with pytest.raises(asyncio.CancelledError):
                await held
            assert await pool.run(jobs.pid) != first
            assert not alive(first)

    run(scenario)


def test_cancelling_a_job_that_waits_kills_nothing() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            running = asyncio.create_task(pool.run(jobs.sleep, 1.0))
            await asyncio.sleep(0.2)
            waiting = asyncio.create_task(pool.run(jobs.sleep, 1.0))
            await asyncio.sleep(0.2)
            waiting.cancel()
            assert await running == "slept"

    run(scenario)


def test_a_warm_up_may_take_longer_than_a_job() -> None:
    async def scenario() -> None:
        async with workers(seconds=0.3, warm_up=partial(jobs.sleep, 1.0)) as pool:
            while not pool.ready:
                await asyncio.sleep(0.1)
            with pytest.raises(JobTimeout):
                await pool.run(jobs.sleep, 5.0)

    run(scenario)


def test_stop_ends_running_jobs() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            process = await pool.run(jobs.pid)
            task = asyncio.create_task(pool.run(jobs.hold))
            await asyncio.sleep(0.3)
        assert not alive(process)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(scenario)


def test_ready_once_a_worker_has_warmed_up() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            assert not pool.ready
            await pool.run(jobs.nothing)
            assert pool.ready
        async with workers(warm_up=jobs.refuse) as pool:
            await pool.run(jobs.nothing)
            assert not pool.ready

    run(scenario)


def test_not_ready_once_the_last_warm_worker_is_gone(tmp_path: Path) -> None:
    model = tmp_path / "model"
    model.touch()

    async def scenario() -> None:
        async with workers(warm_up=partial(jobs.needs, str(model))) as pool:
            first = await pool.run(jobs.pid)
            assert pool.ready
            model.unlink()
            os.kill(first, signal.SIGKILL)
            while pool.ready:
                await asyncio.sleep(0.05)
            # The next one lives, but has no model.
            assert await pool.run(jobs.pid) != first
            assert not pool.ready

    run(scenario)


def test_readiness_returns_without_a_request() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            os.kill(first, signal.SIGKILL)
            while pool.ready:
                await asyncio.sleep(0.05)
            while not pool.ready:
                await asyncio.sleep(0.05)

    run(scenario)


def test_a_process_that_cannot_be_started_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = ProcessPool.schedule
    refusals = [BrokenProcessPool("no more processes")]

    def refuses_once(pool: ProcessPool, *arguments: object, **options: object) -> object:
        if refusals:
            raise refusals.pop()
        return schedule(pool, *arguments, **options)

    monkeypatch.setattr(ProcessPool, "schedule", refuses_once)

    async def scenario() -> None:
        async with workers() as pool:
            assert await pool.run(jobs.sleep, 0.0) == "slept"

    run(scenario)


def test_a_worker_whose_warm_up_kills_it_is_tried_again_without_haste() -> None:
    async def scenario() -> None:
        async with workers(warm_up=jobs.die, seconds=2) as pool:
            with pytest.raises(BusyError):
                await pool.run(jobs.nothing)
            assert not pool.ready

    run(scenario)
