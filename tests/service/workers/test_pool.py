"""Workers: what happens to a job, to its siblings and to the next one."""

from __future__ import annotations

import asyncio
import os
import platform
import resource
import signal
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures.process import BrokenProcessPool
from contextlib import asynccontextmanager
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from threading import Thread

import pytest
from pebble import ProcessPool
from pebble.pool import process as pebble_process

from service.errors import BusyError, GltfError, JobTimeout, UnreadableError, WorkerDied
from service.workers import pool as pools
from service.workers.jobs import subdivide
from service.workers.memory_file import MemoryFile
from service.workers.pool import Workers
from service.workers.progress import ProgressPage
from service.workers.worker import JobFaultError
from tests.support import stand_in_jobs as jobs
from tests.support.handed_in import work_of

PAGE = resource.getpagesize()


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


async def until(holds: Callable[[], bool]) -> None:
    while not holds():
        await asyncio.sleep(0.005)


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
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            with pytest.raises(JobTimeout):
                await pool.run(jobs.hold, must_end=time.monotonic() + 0.5)
            assert await pool.run(jobs.pid) != first
            assert not alive(first)

    run(scenario)


def test_a_dying_worker_takes_only_its_own_job(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers(count=2) as pool:
            neighbour = asyncio.create_task(pool.run(jobs.wait_between, tmp_path))
            await until((tmp_path / "begun").exists)
            with pytest.raises(WorkerDied):
                await pool.run(jobs.die)
            (tmp_path / "go").touch()
            assert alive(await neighbour)
            assert await asyncio.gather(*(pool.run(jobs.sleep, 0.0) for _ in range(4)))

    run(scenario)


def test_a_job_whose_worker_dies_is_done_by_another(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers(count=2) as pool:
            assert alive(await pool.run(jobs.die_once, tmp_path / "died"))
            assert (tmp_path / "died").exists()

    run(scenario)


def test_refused_jobs_leave_no_descriptors_in_their_worker() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            # The first imports what refuses.
            held = []
            for _ in range(6):
                with MemoryFile() as body, MemoryFile() as answer, ProgressPage() as page:
                    body.append(b"no glTF")
                    work = work_of(body, answer, page)
                    with pytest.raises(UnreadableError):
                        await pool.run(subdivide, work)
                held.append(await pool.run(jobs.descriptors))
            assert held[-1] == held[0]

    run(scenario)


def test_a_worker_that_dies_idle_is_replaced() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            os.kill(first, signal.SIGKILL)
            await until(lambda: pool.restarts["idle"] == 1)
            assert await pool.run(jobs.pid) != first

    run(scenario)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
@pytest.mark.parametrize("job", [jobs.leave_freed, jobs.leave_small_ones])
def test_a_worker_that_rests_gives_back_what_its_job_has_freed(
    job: Callable[[], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kept for the next job, it would be counted against those of other workers."""
    monkeypatch.setattr(pools, "WATCH_SECONDS", 0.05)

    async def scenario() -> None:
        async with workers() as pool:
            process = await pool.run(jobs.pid)
            kept = await pool.run(job)
            await until(lambda: jobs.pages(process) < kept - 20 * 2**20 // PAGE)
            assert await pool.run(jobs.pid) == process

    run(scenario)


def test_a_worker_that_cannot_give_back_serves_on(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(pools, "WATCH_SECONDS", 0.05)
    monkeypatch.setattr(pools.worker, "give_back", jobs.fault)

    async def scenario() -> None:
        async with workers() as pool:
            process = await pool.run(jobs.pid)
            await until(lambda: "keeps what its jobs have freed" in caplog.text)
            assert await pool.run(jobs.pid) == process

    run(scenario)


def test_cancelling_kills_the_job_and_frees_its_place(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            held = asyncio.create_task(pool.run(jobs.begin_to_hold, tmp_path / "begun"))
            await until((tmp_path / "begun").exists)
            held.cancel()
            with pytest.raises(asyncio.CancelledError):
                await held
            assert await pool.run(jobs.pid) != first
            assert not alive(first)

    run(scenario)


def test_cancelling_a_job_that_waits_kills_nothing(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers() as pool:
            running = asyncio.create_task(pool.run(jobs.wait_between, tmp_path))
            await until((tmp_path / "begun").exists)
            waiting = asyncio.create_task(pool.run(jobs.pid))
            await asyncio.sleep(0)
            waiting.cancel()
            (tmp_path / "go").touch()
            assert await running == await pool.run(jobs.pid)

    run(scenario)


def test_a_warm_up_may_take_longer_than_a_job() -> None:
    async def scenario() -> None:
        async with workers(seconds=0.3, warm_up=partial(jobs.sleep, 1.0)) as pool:
            while not pool.ready:
                await asyncio.sleep(0.1)
            with pytest.raises(JobTimeout):
                await pool.run(jobs.sleep, 5.0)

    run(scenario)


def test_a_frozen_worker_hangs_nothing() -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            os.kill(first, signal.SIGSTOP)
            # It does not even say that it has begun.
            with pytest.raises(JobTimeout):
                await pool.run(jobs.pid, must_end=time.monotonic() + 0.2)
            assert await pool.run(jobs.pid) != first
            assert pool.restarts == {"job-timeout": 1}

    run(scenario)


def test_a_job_that_looks_ends_itself_and_its_worker_lives_on(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            job = asyncio.create_task(
                pool.run(jobs.wait_between, tmp_path, stop=(tmp_path / "go").touch)
            )
            await until((tmp_path / "begun").exists)
            job.cancel()
            with pytest.raises(asyncio.CancelledError):
                await job
            assert await pool.run(jobs.pid) == first
            assert pool.restarts == {}

    run(scenario)


def test_a_job_that_looks_within_a_second_ends_no_worker(tmp_path: Path) -> None:
    """A large document is decoded in one call, and who sends such ones and leaves costs no more."""

    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            later = partial(asyncio.get_running_loop().call_later, 1.0, (tmp_path / "go").touch)
            job = asyncio.create_task(pool.run(jobs.wait_between, tmp_path, stop=later))
            await until((tmp_path / "begun").exists)
            job.cancel()
            assert await pool.run(jobs.pid) == first
            assert pool.restarts == {}

    run(scenario)


def test_a_job_that_does_not_look_is_killed(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            job = asyncio.create_task(
                pool.run(jobs.begin_to_hold, tmp_path / "begun", stop=jobs.nothing)
            )
            await until((tmp_path / "begun").exists)
            job.cancel()
            assert await pool.run(jobs.pid) != first
            assert pool.restarts == {"stopped": 1}

    run(scenario)


@pytest.mark.parametrize("stop", [None, jobs.nothing])
def test_files_are_held_until_the_worker_that_knows_them_is_dead(
    tmp_path: Path, stop: Callable[[], None] | None
) -> None:
    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            with MemoryFile() as file:
                job = asyncio.create_task(
                    pool.run(jobs.begin_to_hold, tmp_path / "begun", files=[file], stop=stop)
                )
                await until((tmp_path / "begun").exists)
                job.cancel()
                await asyncio.gather(job, return_exceptions=True)
            while not file.closed:
                await asyncio.sleep(0)
            assert not alive(first)

    run(scenario)


def test_stop_ends_running_jobs(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with workers() as pool:
            process = await pool.run(jobs.pid)
            task = asyncio.create_task(pool.run(jobs.begin_to_hold, tmp_path / "begun"))
            await until((tmp_path / "begun").exists)
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


def test_a_worker_whose_warm_up_fails_is_tried_again(tmp_path: Path) -> None:
    """A full disk, say, or no memory for a moment: nobody else would start the service anew."""
    kernels = tmp_path / "kernels"

    async def scenario() -> None:
        async with workers(warm_up=partial(os.stat, kernels)) as pool:
            while not pool.restarts["start"]:
                await asyncio.sleep(0.05)
            kernels.touch()
            while not pool.ready:
                await asyncio.sleep(0.05)

    run(scenario)


@pytest.mark.parametrize("what", ["channels", "launch_process"])
def test_a_process_that_the_system_refuses_is_told_and_tried_again(
    what: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """No descriptor, no semaphore or no process is left: for a while."""
    makes = getattr(pebble_process, what)
    refusals = [OSError(11, "Resource temporarily unavailable")]

    def refuses_once(*arguments: object) -> object:
        if refusals:
            raise refusals.pop()
        return makes(*arguments)

    monkeypatch.setattr(pebble_process, what, refuses_once)

    async def scenario() -> None:
        async with workers() as pool:
            assert await pool.run(jobs.sleep, 0.0) == "slept"

    run(scenario)
    told = "a worker did not start: [Errno 11] Resource temporarily unavailable"
    assert told in caplog.messages


def test_a_worker_is_replaced_where_no_thread_is_left(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A limit on processes counts threads, too."""

    def refuses(thread: Thread) -> None:
        raise RuntimeError("can't start new thread")

    async def scenario() -> None:
        async with workers() as pool:
            first = await pool.run(jobs.pid)
            with MemoryFile() as file:
                began = tmp_path / "began"
                job = asyncio.create_task(pool.run(jobs.wait_once, began, files=[file]))
                await until(began.exists)
                with monkeypatch.context() as system:
                    system.setattr(Thread, "start", refuses)
                    os.kill(first, signal.SIGKILL)
                    await until(lambda: pool.restarts["worker-died"] == 1)
                    await asyncio.sleep(0.05)
                assert await job != first
            assert file.closed
            assert await pool.run(jobs.pid) != first

    run(scenario)


def test_ctrl_c_is_the_server_s_alone() -> None:
    """A terminal sends it to all; a worker that is still importing would draw its traceback.

    So it is with SIGHUP, where the terminal closes.
    """

    # Python starts its own with the first of all workers, which lets through what is blocked.
    resource_tracker._resource_tracker._stop()  # pyright: ignore[reportAttributeAccessIssue]

    async def scenario() -> None:
        async with workers() as pool:
            blocked = await pool.run(signal.pthread_sigmask, signal.SIG_BLOCK, ())
            assert {signal.SIGINT, signal.SIGHUP} <= blocked
            assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())

    run(scenario)


def test_a_warm_up_that_cannot_be_sent_is_told(caplog: pytest.LogCaptureFixture) -> None:
    async def scenario() -> None:
        async with workers(warm_up=lambda: None) as pool:
            await pool.run(jobs.nothing)
            assert not pool.ready

    run(scenario)
    assert any("a worker did not warm up" in message for message in caplog.messages)


def test_a_pool_that_ends_without_a_word_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[ProcessPool] = []
    start = ProcessPool._start_pool

    def seen(pool: ProcessPool) -> None:
        made.append(pool)
        start(pool)

    monkeypatch.setattr(ProcessPool, "_start_pool", seen)

    async def scenario() -> None:
        async with workers() as pool:
            job = asyncio.create_task(pool.run(jobs.wait_once, tmp_path / "begun"))
            await until((tmp_path / "begun").exists)
            # Its threads end, and nobody is left to tell what becomes of the job.
            made[0].stop()
            assert alive(await job)
            assert pool.restarts["worker-died"] == 1

    run(scenario)
