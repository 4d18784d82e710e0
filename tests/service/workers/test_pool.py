"""Workers: what happens to a job, to its siblings and to the next one."""

from __future__ import annotations

import asyncio
import os
import platform
import resource
import signal
from collections import Counter
from contextlib import asynccontextmanager
from functools import partial
from multiprocessing import resource_tracker
from typing import TypeVar

import pytest
from pebble.common import CONSTS
from pebble.pool import process as pebble_process

from service.errors import JobTimeout, WorkerDied
from service.workers import pool as pools
from service.workers.pool import Workers
from tests.support import stand_in_jobs as jobs

pytestmark = pytest.mark.anyio
T = TypeVar("T")
PAGE = resource.getpagesize()


class Counted(Workers):
    """Workers, and how many were replaced by cause."""

    def __init__(self, count, seconds, warm_up):
        self.restarts: Counter[str] = Counter()
        super().__init__(count, seconds, warm_up, lambda cause: self.restarts.update([cause]))


@asynccontextmanager
async def workers(count=1, seconds=30, warm_up=jobs.nothing):
    pool = Counted(count, seconds, warm_up)
    pool.start()
    try:
        async with asyncio.timeout(60):
            yield pool
    finally:
        await pool.stop()


def alive(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def do(pool, function, *arguments, client="a"):
    return pool.run(pool.join(client), function, *arguments)


async def until(holds):
    while not holds():
        await asyncio.sleep(0.005)


@pytest.mark.parametrize("frozen", [False, True])
async def test_a_job_past_its_deadline_is_killed_while_it_holds_the_interpreter_or_is_frozen(
    frozen, monkeypatch
):
    monkeypatch.setattr(CONSTS, "term_timeout", 0.1)

    async with workers(seconds=3) as pool:
        first = await do(pool, jobs.pid)
        if frozen:
            # It does not even say that it has begun.
            os.kill(first, signal.SIGSTOP)
        with pytest.raises(JobTimeout):
            await do(pool, jobs.hold)
        # Its files are closed now, and another job may get their numbers.
        assert not alive(first)
        assert await do(pool, jobs.pid) != first
        assert pool.restarts == {"job-timeout": 1}


async def test_a_dying_worker_takes_only_its_own_job(tmp_path):
    async with workers(count=2) as pool:
        neighbour = asyncio.create_task(do(pool, jobs.wait_between, tmp_path, client="b"))
        await until((tmp_path / "begun").exists)
        with pytest.raises(WorkerDied):
            await do(pool, jobs.die)
        (tmp_path / "go").touch()
        assert alive(await neighbour)
        assert await asyncio.gather(*(do(pool, jobs.sleep, 0.0) for _ in range(4)))


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
@pytest.mark.parametrize("job", [jobs.leave_freed, jobs.leave_small_ones])
async def test_a_worker_that_rests_gives_back_what_its_job_has_freed(job, monkeypatch):
    """Kept for the next job, it would be counted against those of other workers."""
    monkeypatch.setattr(pools, "WATCH_SECONDS", 0.05)

    async with workers() as pool:
        process = await do(pool, jobs.pid)
        kept = await do(pool, job)
        await until(lambda: jobs.pages(process) < kept - 20 * 2**20 // PAGE)
        assert await do(pool, jobs.pid) == process


async def test_cancelling_a_job_that_waits_kills_nothing(tmp_path):
    async with workers() as pool:
        running = asyncio.create_task(do(pool, jobs.wait_between, tmp_path))
        await until((tmp_path / "begun").exists)
        waiting = asyncio.create_task(do(pool, jobs.pid))
        await asyncio.sleep(0)
        waiting.cancel()
        (tmp_path / "go").touch()
        assert await running == await do(pool, jobs.pid)


async def test_a_warm_up_may_take_longer_than_a_job():
    async with workers(seconds=0.3, warm_up=partial(jobs.sleep, 1.0)) as pool:
        await until(lambda: pool.ready)
        with pytest.raises(JobTimeout):
            await do(pool, jobs.sleep, 5.0)


@pytest.mark.parametrize("looks", [True, False])
async def test_a_cancelled_job_ends_itself_where_it_looks_and_is_killed_where_not(looks, tmp_path):
    begun = tmp_path / "took-1"
    async with workers() as pool:
        first = await do(pool, jobs.pid)
        steps, holds = (jobs.take_steps, tmp_path), (jobs.begin_to_hold, begun)
        job = asyncio.create_task(do(pool, *(steps if looks else holds)))
        await until(begun.exists)
        job.cancel()
        with pytest.raises(asyncio.CancelledError):
            await job
        assert alive(first) is looks
        assert (await do(pool, jobs.pid) == first) is looks
        assert pool.restarts == ({} if looks else {"stopped": 1})


async def test_stop_ends_running_jobs(tmp_path):
    async with workers() as pool:
        process = await do(pool, jobs.pid)
        task = asyncio.create_task(do(pool, jobs.begin_to_hold, tmp_path / "begun"))
        await until((tmp_path / "begun").exists)
    assert not alive(process)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_ready_while_a_worker_that_has_warmed_up_lives(tmp_path):
    model = tmp_path / "model"
    model.touch()
    async with workers(warm_up=partial(jobs.needs, str(model))) as pool:
        assert not pool.ready
        first = await do(pool, jobs.pid)
        assert pool.ready
        model.unlink()
        os.kill(first, signal.SIGKILL)
        await until(lambda: not pool.ready)
        await until(lambda: pool.restarts["idle"] == 1)
        # The next one lives, but has no model.
        assert await do(pool, jobs.pid) != first
        assert not pool.ready


async def test_a_worker_whose_warm_up_fails_is_tried_again(tmp_path):
    """A full disk, say, or no memory for a moment: nobody else would start the service anew."""
    kernels = tmp_path / "kernels"

    async with workers(warm_up=partial(os.stat, kernels)) as pool:
        await until(lambda: pool.restarts["start"] > 0)
        kernels.touch()
        await until(lambda: pool.ready)


@pytest.mark.parametrize("what", ["channels", "launch_process"])
async def test_a_process_that_the_system_refuses_is_told_and_tried_again(what, monkeypatch, caplog):
    """No descriptor, no semaphore or no process is left: for a while."""
    makes = getattr(pebble_process, what)
    refusals = [OSError(11, "Resource temporarily unavailable")]

    def refuses_once(*arguments):
        if refusals:
            raise refusals.pop()
        return makes(*arguments)

    monkeypatch.setattr(pebble_process, what, refuses_once)

    async with workers() as pool:
        assert await do(pool, jobs.sleep, 0.0) == "slept"
    told = "a worker did not start: [Errno 11] Resource temporarily unavailable"
    assert told in caplog.messages


async def test_ctrl_c_is_the_server_s_alone():
    """A terminal sends it to all; a worker that is still importing would draw its traceback.

    So it is with SIGHUP, where the terminal closes.
    """

    # Python starts its own with the first of all workers, which lets through what is blocked.
    resource_tracker._resource_tracker._stop()  # pyright: ignore[reportAttributeAccessIssue]

    async with workers() as pool:
        blocked = await do(pool, signal.pthread_sigmask, signal.SIG_BLOCK, ())
        assert {signal.SIGINT, signal.SIGHUP} <= blocked
        assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


async def test_one_client_leaves_a_worker_to_others_and_who_came_first_is_next(tmp_path):
    """Six jobs without an end would else stop all work."""
    async with workers(count=2) as pool:
        await until(lambda: [each.holder for each in pool._processes] == [None] * 2)
        endless, turns = [], []
        for number in range(6):
            turns.append(pool.join("greedy"))
            job = pool.run(turns[-1], jobs.begin_to_hold, tmp_path / str(number))
            endless.append(asyncio.create_task(job))
        await until((tmp_path / "0").exists)
        assert [pool.place(turn) for turn in turns] == [0, 0, 1, 2, 3, 4]
        for _ in range(3):
            assert await do(pool, jobs.sleep, 0.0, client="honest") == "slept"
        assert [path.name for path in tmp_path.iterdir()] == ["0"]
        for job in endless:
            job.cancel()
        await asyncio.gather(*endless, return_exceptions=True)


async def test_who_leaves_holds_its_worker_until_there_is_another(tmp_path):
    """Else one client that comes and goes would end all workers at once."""
    async with workers(count=2) as pool:
        await until(lambda: [each.holder for each in pool._processes] == [None] * 2)
        job = asyncio.create_task(do(pool, jobs.begin_to_hold, tmp_path / "begun"))
        await until((tmp_path / "begun").exists)
        job.cancel()
        await asyncio.gather(job, return_exceptions=True)
        again = pool.join("a")
        assert not again.process.done()
        assert await do(pool, jobs.sleep, 0.0, client="b") == "slept"
        assert not again.process.done()
        assert await pool.run(again, jobs.sleep, 0.0) == "slept"
        assert pool.restarts == {"stopped": 1}
        assert pool.held == {}
