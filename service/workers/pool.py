"""Worker processes and whose turn is next.

Jobs run where they can be killed and cannot hold the server's interpreter. One rule is fair: a
client holds at most all workers but one (the only one where there is one), until what it has left
or broken is free again; of the others who came first is next.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Any, TypeVar

from pebble import ProcessExpired, ProcessPool

from ..errors import BusyError, JobTimeout, WorkerDied
from . import worker

T = TypeVar("T")

# Where a fresh process cannot even warm up, the next one is not started at once.
RESTART_SECONDS = 5.0
# A warm-up imports and loads; with the extra `jit` it compiles, for minutes on a busy machine.
WARM_UP_SECONDS = 600.0
# How long a worker may take to end a job by itself, when it is asked to, before it is killed. A
# fresh one takes longer to warm up.
GRACE_SECONDS = 0.75
# How long a worker that has died may go unnoticed where nothing reports it.
WATCH_SECONDS = 1.0

log = logging.getLogger("pns.service")


@dataclass(eq=False)
class Turn:
    """A client's place in the line for a worker; `began` is when it got one."""

    client: str
    pool: asyncio.Future[ProcessPool] = field(repr=False)
    began: float | None = None


class Workers:
    """`count` worker processes, each with one job at a time of at most `seconds`.

    Every process has a pebble pool of its own: a pool breaks with a process that dies idle, and
    breaks nothing which another request waits on. A pool whose job did not come back is thrown away
    and replaced; `replaced` is told why. `warm_up` is called in each new process, before any job.
    """

    def __init__(
        self,
        count: int,
        seconds: float,
        warm_up: Callable[[], object],
        replaced: Callable[[str], None],
    ) -> None:
        self._count = count
        self._seconds = seconds
        self._warm_up = warm_up
        self._replaced = replaced
        self._most = max(1, count - 1)
        self._waiting: list[Turn] = []
        self._free: list[ProcessPool] = []
        self._pools: set[ProcessPool] = set()
        self._warm: set[ProcessPool] = set()
        self._holders: dict[ProcessPool, str] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._ends: dict[ProcessPool, asyncio.Task[None]] = {}
        self._stopping = False
        self.held: Counter[str] = Counter()
        """Number of workers by client, those that end its last job among them."""

    @property
    def ready(self) -> bool:
        """True while a worker that has warmed up is alive."""
        return any(pool.active for pool in self._warm)

    @property
    def waiting(self) -> int:
        """Number of jobs that wait for a worker."""
        return len(self._waiting)

    def start(self) -> None:
        """Start the processes; they warm up in the background."""
        # Python's own allocator keeps a MiB for each small object that is left in it: a document of
        # countless parts would stay for good. What glibc's has free it gives back page by page.
        os.environ.setdefault("PYTHONMALLOC", "malloc")
        for _ in range(self._count):
            self._in_background(self._add(""))
        self._in_background(self._watch())

    async def stop(self) -> None:
        """End every process, whatever it is doing."""
        self._stopping = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(self._end(pool) for pool in self._pools))

    def join(self, client: str) -> Turn:
        """Stand in line. `run` must follow."""
        turn = Turn(client, asyncio.get_running_loop().create_future())
        self._waiting.append(turn)
        self._grant()
        return turn

    def place(self, turn: Turn | None) -> int:
        """Count the jobs in front of one that waits."""
        return self._waiting.index(turn) if turn in self._waiting else 0

    async def run(
        self,
        turn: Turn,
        function: Callable[..., T],
        *arguments: object,
        stop: Callable[[], None] = lambda: None,
    ) -> T:
        """Return the value of `function(*arguments)`, called in a worker once it is its turn.

        Cancelling this call ends the work: `stop` asks the job to end itself, and a worker that has
        not come back shortly after is killed.

        Raises:
            what the function raises (ServiceError as it is, anything else as worker.JobFaultError);
            BusyError: no worker became free within the seconds of a job.
            JobTimeout: it ran longer than these; its worker is killed.
            WorkerDied: the process ended.
        """
        pool = await self._come(turn)
        turn.began = time.monotonic()
        try:
            future = _scheduled(pool, function, *arguments)
            value = await _result(pool, future, self._seconds)
        except asyncio.CancelledError:
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

    async def _come(self, turn: Turn) -> ProcessPool:
        try:
            async with asyncio.timeout(self._seconds):
                return await turn.pool
        except BaseException as error:
            if turn in self._waiting:
                self._waiting.remove(turn)
            elif turn.pool.done() and not turn.pool.cancelled():
                # Its turn came in the same moment.
                self._let_go(turn.pool.result())
            if isinstance(error, TimeoutError):
                raise BusyError("no worker became free in time", retry_after=5) from error
            raise

    def _grant(self) -> None:
        """Give every free worker that lives to the first in line whose client may hold one more."""
        for pool in [pool for pool in self._free if not pool.active]:
            self._free.remove(pool)
            self._replace(pool, "idle")
        for turn in tuple(self._waiting):
            if not self._free:
                return
            if self.held[turn.client] < self._most and not turn.pool.done():
                self._waiting.remove(turn)
                pool = self._free.pop(0)
                self._holders[pool] = turn.client
                self.held[turn.client] += 1
                turn.pool.set_result(pool)

    def _let_go(self, pool: ProcessPool) -> None:
        """Take back a worker."""
        self._forgive(self._holders.pop(pool, ""))
        self._free.append(pool)
        self._grant()

    def _forgive(self, client: str) -> None:
        self.held[client] -= 1
        self.held += Counter()

    async def _watch(self) -> None:
        """Replace those that die while they are idle: with no request to find it, none would be."""
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            self._grant()

    async def _wind_down(self, pool: ProcessPool, future: asyncio.Future[Any]) -> None:
        """Give a job that nobody wants the time to end itself."""
        await asyncio.wait({future}, timeout=GRACE_SECONDS)
        if future.done() and not _lost(future):
            self._let_go(pool)
        else:
            self._replace(pool, "stopped")

    def _replace(self, pool: ProcessPool, cause: str) -> None:
        """End a process and start another, which its client holds until it is there."""
        self._warm.discard(pool)
        if not self._stopping:
            self._replaced(cause)
            self._in_background(self._add(self._holders.pop(pool, ""), pool))

    async def _add(self, holder: str, instead: ProcessPool | None = None) -> None:
        """Start a process, and put it among the free ones once it has warmed up."""
        while True:
            if instead is not None:
                await asyncio.shield(self._end(instead))
                self._pools.discard(instead)
                del self._ends[instead]
            pool = ProcessPool(
                max_workers=1,
                initializer=worker.prepare,
                # Spawn, not fork: the server has threads, and a fork of them may deadlock.
                context=multiprocessing.get_context("spawn"),
            )
            self._pools.add(pool)
            try:
                await _result(pool, _scheduled(pool, self._warm_up), WARM_UP_SECONDS)
                self._warm.add(pool)
            except (JobTimeout, WorkerDied, worker.JobFaultError) as error:
                # What a disk had no room for, say, it may have soon.
                log.warning("a worker did not start: %s", _reason(error))
                self._replaced("start")
                await asyncio.sleep(RESTART_SECONDS)
                instead = pool
                continue
            except Exception as error:
                # A model does not load, say: the process serves what needs none.
                log.warning("a worker did not warm up: %s", error)
            self._holders[pool] = holder
            self._let_go(pool)
            return

    def _end(self, pool: ProcessPool) -> asyncio.Task[None]:
        """End a process, once: pebble may hang where two threads do."""
        if pool not in self._ends:
            self._ends[pool] = asyncio.get_running_loop().create_task(_end(pool))
        return self._ends[pool]

    def _in_background(self, work: Coroutine[object, object, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _scheduled(
    pool: ProcessPool, function: Callable[..., T], *arguments: object
) -> asyncio.Future[T]:
    """Schedule what a process is to answer. Nothing ever cancels it: pebble would act on that."""
    try:
        # The first call starts the process.
        with worker.no_interrupt():
            future = asyncio.wrap_future(pool.schedule(worker.call, args=(function, *arguments)))
    except (RuntimeError, OSError) as error:
        # The process could not be started, or has died since the pool was looked at.
        raise WorkerDied("no worker process could be started") from error
    # What comes after everybody has gone is nobody's surprise.
    future.add_done_callback(_lost)
    return future


async def _result(pool: ProcessPool, future: asyncio.Future[T], seconds: float) -> T:
    # The clock is ours: pebble's begins with the worker's word that it has begun, and a process
    # that is frozen says none.
    end, silent = time.monotonic() + seconds, False
    while not (future.done() or silent) and (left := end - time.monotonic()) > 0:
        # A pool may end without a word; what it tells of its end it tells soon after.
        silent = not pool.active
        await asyncio.wait({future}, timeout=min(left, WATCH_SECONDS))
    if not (future.done() or silent):
        raise JobTimeout(f"the job took longer than {seconds:g} seconds")
    if not future.done() or _lost(future):
        error = future.exception() if future.done() and not future.cancelled() else None
        if isinstance(error, ProcessExpired) and error.exitcode is not None:
            code = int(error.exitcode)
            how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
            log.warning("worker process %s ended: %s", error.pid, how)
        raise WorkerDied(
            "the worker process ended before it answered; it may have run out of memory"
        )
    return future.result()


def _reason(error: BaseException) -> BaseException:
    """Return what an error began with: pebble's own, in between, may say nothing."""
    return error if error.__cause__ is None else _reason(error.__cause__)


def _lost(future: asyncio.Future[Any]) -> bool:
    """Return whether the process ended instead of answering."""
    return future.cancelled() or isinstance(future.exception(), (ProcessExpired, BrokenProcessPool))


async def _end(pool: ProcessPool) -> None:
    """End a process; SIGTERM at once, SIGKILL where that does not do."""

    def end() -> None:
        pool.stop()
        pool.join()

    try:
        await asyncio.to_thread(end)
    except RuntimeError:
        # No thread is left to wait in, and nothing else would start the next process.
        end()
