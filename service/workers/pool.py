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
from .progress import Progress

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


class _Process:
    """A worker process, in a pebble pool of its own.

    A pool breaks with a process that dies idle, and breaks nothing which another request waits on.

    Attributes:
        holder: the client that has it; None: it is free; "": the service itself.
        warm: whether it has what jobs need.
        broken: why its job did not come back: another process is to come in its place.
        ended: whether it is gone.
    """

    def __init__(self, holder: str, progress: Progress) -> None:
        self.progress = progress
        self.pool = ProcessPool(
            max_workers=1,
            initializer=worker.prepare,
            initargs=(progress,),
            # Spawn, not fork: the server has threads, and a fork of them may deadlock.
            context=multiprocessing.get_context("spawn"),
        )
        self.holder: str | None = holder
        self.warm = False
        self.broken: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.ended = asyncio.Event()

    async def end(self) -> None:
        """End the process; SIGTERM at once, SIGKILL where that does not do."""

        def end() -> None:
            self.pool.stop()
            self.pool.join()

        try:
            await asyncio.to_thread(end)
        except RuntimeError:
            # No thread is left to wait in, and nothing else would start the next process.
            end()
        self.ended.set()


@dataclass(eq=False)
class Turn:
    """A client's place in the line for a worker.

    `began` is when it got one, and `progress` that of its job since then.
    """

    client: str
    process: asyncio.Future[_Process] = field(repr=False)
    began: float | None = None
    progress: Progress | None = None


class Workers:
    """`count` worker processes, each with one job at a time of at most `seconds`.

    A process whose job did not come back is ended and replaced; `replaced` is told why. `warm_up`
    is called in each new process, before any job.
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
        self._processes: list[_Process] = []
        self._keepers: list[asyncio.Task[None]] = []

    @property
    def ready(self) -> bool:
        """True while a worker that has warmed up is alive."""
        return any(process.warm and process.pool.active for process in self._processes)

    @property
    def waiting(self) -> int:
        """Number of jobs that wait for a worker."""
        return len(self._waiting)

    @property
    def held(self) -> Counter[str]:
        """Number of workers by client, those that end its last job among them."""
        return Counter(process.holder for process in self._processes if process.holder)

    def start(self) -> None:
        """Start the processes; they warm up in the background."""
        # Python's own allocator keeps a MiB for each small object that is left in it: a document of
        # countless parts would stay for good. What glibc's has free it gives back page by page.
        os.environ.setdefault("PYTHONMALLOC", "malloc")
        loop = asyncio.get_running_loop()
        self._keepers = [loop.create_task(self._keep_one()) for _ in range(self._count)]

    async def stop(self) -> None:
        """End every process, whatever it is doing."""
        for keeper in self._keepers:
            keeper.cancel()
        await asyncio.gather(*self._keepers, return_exceptions=True)

    def join(self, client: str) -> Turn:
        """Stand in line. `run` must follow."""
        turn = Turn(client, asyncio.get_running_loop().create_future())
        self._waiting.append(turn)
        self._grant()
        return turn

    def place(self, turn: Turn | None) -> int:
        """Count the jobs in front of one that waits."""
        return self._waiting.index(turn) if turn in self._waiting else 0

    async def run(self, turn: Turn, function: Callable[..., T], *arguments: object) -> T:
        """Return the value of `function(*arguments)`, called in a worker once it is its turn.

        Cancelling this call ends the work: the job is asked to end itself, and a worker that has
        not come back shortly after is killed. However it ends, no worker is in the job after it.

        Raises:
            what the function raises (ServiceError as it is, anything else as worker.JobFaultError);
            BusyError: no worker became free within the seconds of a job.
            JobTimeout: it ran longer than these; its worker is killed.
            WorkerDied: the process ended.
        """
        process = await self._come(turn)
        process.progress.clear()
        turn.began, turn.progress = time.monotonic(), process.progress
        future = _scheduled(process.pool, function, *arguments)
        why = None
        try:
            return await _result(process.pool, future, self._seconds)
        except asyncio.CancelledError:
            process.progress.stop()
            await _whole(asyncio.wait({future}, timeout=GRACE_SECONDS))
            why = "stopped" if not future.done() or _lost(future) else None
            raise
        except (JobTimeout, WorkerDied) as error:
            why = error.code
            raise
        finally:
            if why is None:
                self._let_go(process)
            else:
                process.warm = False
                process.broken.set_result(why)
                await _whole(process.ended.wait())

    async def _come(self, turn: Turn) -> _Process:
        try:
            async with asyncio.timeout(self._seconds):
                return await turn.process
        except BaseException as error:
            if turn in self._waiting:
                self._waiting.remove(turn)
            elif turn.process.done() and not turn.process.cancelled():
                # Its turn came in the same moment.
                self._let_go(turn.process.result())
            if isinstance(error, TimeoutError):
                raise BusyError("no worker became free in time", retry_after=5) from error
            raise

    def _grant(self) -> None:
        """Give every free worker that lives to the first in line whose client may hold one more."""
        free = [each for each in self._processes if each.holder is None and each.pool.active]
        for turn in tuple(self._waiting):
            if free and self.held[turn.client] < self._most and not turn.process.done():
                self._waiting.remove(turn)
                process = free.pop(0)
                process.holder = turn.client
                turn.process.set_result(process)

    def _let_go(self, process: _Process) -> None:
        """Take back a worker."""
        process.holder = None
        self._grant()

    async def _keep_one(self) -> None:
        """Keep a process, and another one in its place whenever it breaks.

        Until that is there, the client whose job broke the last one holds it.
        """
        holder, progress = "", Progress()
        while True:
            process = _Process(holder, progress)
            self._processes.append(process)
            try:
                await self._warmed_up(process)
                while not process.broken.done():
                    await asyncio.wait({process.broken}, timeout=WATCH_SECONDS)
                    # With no request to find one that died while it was free, none would be.
                    if process.holder is None and not process.pool.active:
                        process.broken.set_result("idle")
            finally:
                await _whole(process.end())
                self._processes.remove(process)
            holder = process.holder or ""
            self._replaced(process.broken.result())
            if process.broken.result() == "start":
                await asyncio.sleep(RESTART_SECONDS)

    async def _warmed_up(self, process: _Process) -> None:
        try:
            await _result(process.pool, _scheduled(process.pool, self._warm_up), WARM_UP_SECONDS)
            process.warm = True
        except (JobTimeout, WorkerDied, worker.JobFaultError) as error:
            # What a disk had no room for, say, it may have soon.
            log.warning("a worker did not start: %s", _reason(error))
            process.broken.set_result("start")
            return
        except Exception as error:
            # A model does not load, say: the process serves what needs none.
            log.warning("a worker did not warm up: %s", error)
        self._let_go(process)


async def _whole(work: Coroutine[Any, Any, object]) -> None:
    """Await what must not be left half done, and only then be cancelled."""
    task = asyncio.ensure_future(work)
    cancelled = None
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        raise cancelled


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
        future = asyncio.get_running_loop().create_future()
        died = WorkerDied("no worker process could be started")
        died.__cause__ = error
        future.set_exception(died)
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
