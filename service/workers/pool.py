"""Worker processes: jobs run where they can be killed and cannot hold the server's interpreter."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
import time
from collections import Counter
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from ..errors import BusyError, JobTimeout, WorkerDied
from . import worker
from .memory_file import MemoryFile
from .worker import no_interrupt

T = TypeVar("T")

# Where a fresh process cannot even warm up, the next one is not started at once.
RESTART_SECONDS = 5.0
# A warm-up imports and loads; with the extra `jit` it compiles, for minutes on a busy machine.
WARM_UP_SECONDS = 600.0
# How long a worker may take to end a job by itself, when it is asked to, before it is killed. A
# fresh one takes as long to warm up: to kill it earlier would only let those who leave end workers
# faster than they start, with bodies that take long to decode.
GRACE_SECONDS = 2.0
# How long a worker that has died may go unnoticed where nothing tells of it, and one that rests may
# keep what its last job has freed.
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
        # Those that may hold what they have freed: for a next job at once, not while they rest.
        self._used: set[ProcessPool] = set()
        self._ends: set[asyncio.Task[None]] = set()
        self._known: dict[ProcessPool, Sequence[MemoryFile]] = {}
        self._stopping = False
        self.restarts: Counter[str] = Counter()
        """Number of replaced processes, by cause."""
        self.warmed = False
        """True once a worker has warmed up."""

    @property
    def ready(self) -> bool:
        """True while a worker that has warmed up is alive."""
        return any(pool.active for pool in self._warm)

    def start(self) -> None:
        """Start the processes; they warm up in the background."""
        # Python's own allocator keeps a MiB for each small object that is left in it: a document of
        # countless parts would stay for good. What glibc's has free it gives back page by page.
        os.environ.setdefault("PYTHONMALLOC", "malloc")
        for _ in range(self._count):
            self._in_background(self._add())
        self._in_background(self._watch())

    async def stop(self) -> None:
        """End every process, whatever it is doing."""
        self._stopping = True
        for task in self._background:
            task.cancel()
        await asyncio.gather(*self._background, return_exceptions=True)
        for pool in tuple(self._pools):
            self._end(pool)
        await asyncio.gather(*self._ends)

    async def run(
        self,
        function: Callable[..., T],
        *arguments: object,
        files: Sequence[MemoryFile] = (),
        must_end: float | None = None,
        stop: Callable[[], None] | None = None,
        taken: Callable[[], None] = lambda: None,
    ) -> T:
        """Return the value of `function(*arguments)`, called in a worker once one is free.

        `taken` is called once a worker is free: before, another's may still be ending, or starting.

        `files` are those that the arguments name: they are held until the function has come back
        or its process is dead, whatever becomes of this call. It comes back before `must_end` (on
        the clock of `time.monotonic`; None: within the seconds of a job), whether the worker says
        anything or not.

        Cancelling this call ends the work: `stop` is called to ask for it, and a worker that has
        not come back shortly after is killed, at once where there is no `stop`.

        Jobs have no side effects: one whose process ended is tried once more, in another.

        Raises what the function raises (ServiceError as it is, anything else as
        worker.JobFaultError), BusyError where no worker becomes free, JobTimeout past the deadline,
        WorkerDied where the process ended twice.
        """
        if must_end is None:
            must_end = time.monotonic() + self._seconds

        async def attempt() -> T:
            return await self._run_once(
                function, *arguments, files=files, must_end=must_end, stop=stop, taken=taken
            )

        try:
            return await attempt()
        except WorkerDied as error:
            log.warning("a job is tried again: %s", error)
            return await attempt()

    async def _run_once(
        self,
        function: Callable[..., T],
        *arguments: object,
        files: Sequence[MemoryFile],
        must_end: float,
        stop: Callable[[], None] | None,
        taken: Callable[[], None],
    ) -> T:
        pool = await self._take(must_end)
        taken()
        for file in files:
            file.hold()
        self._known[pool] = files
        try:
            future = _scheduled(pool, function, *arguments)
            value = await _result(pool, future, must_end)
        except asyncio.CancelledError:
            if stop is None:
                self._replace(pool, "stopped")
            else:
                stop()
                self._in_background(self._wind_down(pool, future))  # pyright: ignore[reportPossiblyUnboundVariable]
            raise
        except (JobTimeout, WorkerDied) as error:
            self._replace(pool, error.code)
            raise
        except BaseException:
            self._let_go(pool)
            raise
        self._let_go(pool)
        return value

    async def _take(self, must_end: float) -> ProcessPool:
        """Take a free pool; those whose idle process has died meanwhile are replaced."""
        try:
            async with asyncio.timeout(must_end - time.monotonic()):
                while not (pool := await self._free.get()).active:
                    self._replace(pool, "idle")
                return pool
        except TimeoutError as error:
            raise BusyError("no worker became free in time") from error

    async def _watch(self) -> None:
        """Look after those that are idle.

        One that has died is replaced: with no request to find it, readiness would not return. One
        that had a job gives back what that has freed, hundreds of megabytes perhaps.
        """
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            for _ in range(self._free.qsize()):
                pool = self._free.get_nowait()
                if not pool.active:
                    self._replace(pool, "idle")
                elif pool in self._used:
                    self._in_background(self._give_back(pool))
                else:
                    self._free.put_nowait(pool)

    async def _give_back(self, pool: ProcessPool) -> None:
        self._used.discard(pool)
        try:
            future = _scheduled(pool, worker.give_back)
            await _result(pool, future, time.monotonic() + self._seconds)
        except (JobTimeout, WorkerDied):
            self._replace(pool, "idle")
            return
        except Exception as error:
            # It serves all the same.
            log.warning("a worker keeps what its jobs have freed: %s", error)
        self._free.put_nowait(pool)

    async def _wind_down(self, pool: ProcessPool, future: asyncio.Future[T]) -> None:
        """Give a job that nobody wants the time to end itself."""
        try:
            await asyncio.wait({future}, timeout=GRACE_SECONDS)
        finally:
            if future.done() and not _lost(future):
                self._let_go(pool)
            else:
                self._replace(pool, "stopped")

    async def _add(self) -> None:
        """Start one more process, and put it among the free ones once it has warmed up."""
        pool = ProcessPool(
            max_workers=1,
            initializer=worker.prepare,
            # Spawn, not fork: the server has threads, and a fork of them may deadlock.
            context=multiprocessing.get_context("spawn"),
        )
        self._pools.add(pool)
        try:
            future = _scheduled(pool, self._warm_up)
            await _result(pool, future, time.monotonic() + WARM_UP_SECONDS)
        except (JobTimeout, WorkerDied, worker.JobFaultError) as error:
            # What a disk had no room for, say, it may have soon.
            log.warning("a worker did not start: %s", _reason(error))
            await asyncio.sleep(RESTART_SECONDS)
            self._replace(pool, "start")
            return
        except Exception as error:
            # A model does not load, say: the process serves what needs none.
            log.warning("a worker did not warm up: %s", error)
        else:
            self._warm.add(pool)
            self.warmed = True
        self._let_go(pool)

    def _let_go(self, pool: ProcessPool) -> None:
        self._release(pool)
        self._used.add(pool)
        self._free.put_nowait(pool)

    def _release(self, pool: ProcessPool) -> None:
        for file in self._known.pop(pool, ()):
            file.release()

    def _replace(self, pool: ProcessPool, cause: str) -> None:
        end = self._end(pool)
        if not self._stopping:
            self.restarts[cause] += 1
            self._in_background(self._add_after(end))

    async def _add_after(self, end: asyncio.Task[None]) -> None:
        await asyncio.shield(end)
        await self._add()

    def _end(self, pool: ProcessPool) -> asyncio.Task[None]:
        """End a process, whoever waits for that, and then let go of the files that it knows."""

        async def end() -> None:
            try:
                await asyncio.to_thread(_stop, pool)
            except RuntimeError:
                # No thread is left to wait in, and nothing else would start the next process.
                _stop(pool)
            self._release(pool)

        self._pools.discard(pool)
        self._warm.discard(pool)
        self._used.discard(pool)
        task = asyncio.get_running_loop().create_task(end())
        self._ends.add(task)
        task.add_done_callback(self._ends.discard)
        return task

    def _in_background(self, work: Coroutine[object, object, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._background.add(task)
        task.add_done_callback(self._background.discard)


def _scheduled(
    pool: ProcessPool, function: Callable[..., T], *arguments: object
) -> asyncio.Future[T]:
    """Schedule what a process is to answer. Nothing ever cancels it: pebble would act on that."""
    try:
        # The first call starts the process.
        with no_interrupt():
            future = asyncio.wrap_future(pool.schedule(worker.call, args=(function, *arguments)))
    except (RuntimeError, OSError) as error:
        # The process could not be started, or has died since the pool was looked at.
        raise WorkerDied("no worker process could be started") from error
    # What comes after everybody has gone is nobody's surprise.
    future.add_done_callback(_lost)
    return future


async def _result(pool: ProcessPool, future: asyncio.Future[T], must_end: float) -> T:
    silent = False
    # The clock is ours: a process that is frozen does not even say that it has begun.
    while not (future.done() or silent) and (left := must_end - time.monotonic()) > 0:
        # A pool may end without a word; what it tells of its end it tells soon after.
        silent = not pool.active
        await asyncio.wait({future}, timeout=min(left, WATCH_SECONDS))
    if not (future.done() or silent):
        raise JobTimeout("the job took longer than a job may")
    if not future.done() or _lost(future):
        _log_end(future)
        raise WorkerDied(
            "the worker process ended before it answered; it may have run out of memory"
        )
    return future.result()


def _log_end(future: asyncio.Future[T]) -> None:
    """Log which process ended, and how, where its pool has told it."""
    error = future.exception() if future.done() and not future.cancelled() else None
    if isinstance(error, ProcessExpired) and error.exitcode is not None:
        code = int(error.exitcode)
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        log.warning("worker process %s ended: %s", error.pid, how)


def _reason(error: BaseException) -> BaseException:
    """Return what an error began with: pebble's own, in between, may say nothing."""
    return error if error.__cause__ is None else _reason(error.__cause__)


def _lost(future: asyncio.Future[T]) -> bool:
    """Return whether the process ended instead of answering."""
    return future.cancelled() or isinstance(future.exception(), (ProcessExpired, BrokenProcessPool))


def _stop(pool: ProcessPool) -> None:
    pool.stop()
    pool.join()
