"""Worker processes: jobs run where they can be killed and cannot hold the server's interpreter."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
from collections.abc import Callable, Coroutine
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from service import worker
from service.errors import BusyError, JobTimeout, ServiceError, WorkerDied

T = TypeVar("T")

# Where a fresh process cannot even warm up, the next one is not started at once.
RESTART_SECONDS = 1.0
# A warm-up imports and loads; a short limit on jobs must not keep every worker from starting.
WARM_UP_SECONDS = 120.0
# How long a worker that has died may go unnoticed while none is asked for.
WATCH_SECONDS = 1.0

log = logging.getLogger("pns.service")


class Workers:
    """`count` worker processes, each with one job at a time.

    Every process has a pebble pool of its own, so that a worker that dies or is killed breaks
    nothing which another request waits on. A pool whose job did not come back is thrown away and
    replaced. `warm_up` is called in each new process before it takes jobs.
    """

    def __init__(self, count: int, seconds: float, warm_up: Callable[[], object]) -> None:
        self._count = count
        self._seconds = seconds
        self._warm_up = warm_up
        self._free: asyncio.Queue[ProcessPool] = asyncio.Queue()
        self._pools: set[ProcessPool] = set()
        self._background: set[asyncio.Task[None]] = set()
        self._warm: set[ProcessPool] = set()

    @property
    def ready(self) -> bool:
        """Whether a worker that has warmed up is alive."""
        return any(pool.active for pool in self._warm)

    def start(self) -> None:
        """Start the processes; they warm up in the background."""
        for _ in range(self._count):
            self._in_background(self._add())
        self._in_background(self._watch())

    async def stop(self) -> None:
        """End every process, whatever it is doing."""
        for task in self._background:
            task.cancel()
        await asyncio.gather(*self._background, return_exceptions=True)
        await asyncio.gather(*(asyncio.to_thread(_end, pool) for pool in self._pools))
        self._pools.clear()

    async def run(self, function: Callable[..., T], *arguments: object) -> T:
        """The value of `function(*arguments)`, called in a worker once one is free.

        Cancelling this call kills the worker. Raises what the function raises (ServiceError as it
        is, anything else as worker.JobFaultError), BusyError where no worker becomes free,
        JobTimeout past the deadline, WorkerDied where the process ended.
        """
        pool = await self._take()
        try:
            value = await self._call(pool, self._seconds, function, *arguments)
        except (JobTimeout, WorkerDied, asyncio.CancelledError):
            self._in_background(self._replace(pool))
            raise
        except BaseException:
            self._free.put_nowait(pool)
            raise
        self._free.put_nowait(pool)
        return value

    async def _take(self) -> ProcessPool:
        """A free pool; those whose idle process has died meanwhile are replaced."""
        try:
            async with asyncio.timeout(self._seconds):
                while not (pool := await self._free.get()).active:
                    self._in_background(self._replace(pool))
                return pool
        except TimeoutError as error:
            raise BusyError(f"no worker became free in {self._seconds:g} seconds") from error

    async def _watch(self) -> None:
        """Replace those that die idle: with no request to find them, readiness would not return."""
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            for _ in range(self._free.qsize()):
                pool = self._free.get_nowait()
                if pool.active:
                    self._free.put_nowait(pool)
                else:
                    self._in_background(self._replace(pool))

    async def _call(
        self, pool: ProcessPool, seconds: float, function: Callable[..., T], *arguments: object
    ) -> T:
        try:
            future = pool.schedule(worker.call, args=(function, *arguments), timeout=seconds)
        except RuntimeError as error:
            # The process could not be started, or has died since the pool was looked at.
            raise WorkerDied("no worker process could be started") from error
        try:
            return await asyncio.wrap_future(future)
        except TimeoutError as error:
            raise JobTimeout(f"the job ran longer than {seconds:g} seconds") from error
        except (ProcessExpired, BrokenProcessPool) as error:
            raise WorkerDied(
                "the worker process ended before it answered; it may have run out of memory"
            ) from error

    async def _add(self) -> None:
        pool = ProcessPool(
            max_workers=1,
            initializer=worker.prepare,
            # Spawn, not fork: the server has threads, and a fork of them may deadlock.
            context=multiprocessing.get_context("spawn"),
        )
        self._pools.add(pool)
        try:
            await self._call(pool, WARM_UP_SECONDS, self._warm_up)
        except (JobTimeout, WorkerDied) as error:
            log.warning("a worker did not start: %s", error)
            await asyncio.sleep(RESTART_SECONDS)
            self._in_background(self._replace(pool))
            return
        except (ServiceError, worker.JobFaultError) as error:
            # The process lives: it may still serve what does not need the thing that failed.
            log.warning("a worker did not warm up: %s", error)
        else:
            self._warm.add(pool)
        self._free.put_nowait(pool)

    async def _replace(self, pool: ProcessPool) -> None:
        self._pools.discard(pool)
        self._warm.discard(pool)
        await asyncio.to_thread(_end, pool)
        await self._add()

    def _in_background(self, work: Coroutine[object, object, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._background.add(task)
        task.add_done_callback(self._background.discard)


def _end(pool: ProcessPool) -> None:
    pool.stop()
    pool.join()
