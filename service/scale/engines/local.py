"""Tasks done in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

from ...errors import WorkerDied
from ...workers.worker import end_with_parent, no_interrupt
from . import work as chunks
from .work import Done, Engine, R, T, Work

if TYPE_CHECKING:
    from pebble import ProcessPool

# Workers that may end in a row while they do no task: so many are not killed by chance.
MOST_BROKEN = 100
# A process ends itself past a task's time; this is for one that cannot, beyond a chunk's seconds.
GRACE_SECONDS = 5.0
# How often is looked after pools that may have ended.
LOOK_SECONDS = 1.0
NO_TASK = -1

# In a worker: memory that its driver sees too, with the number of the task it is at.
_current: ContextVar[Any] = ContextVar("current")


def local(work: Work[T, R], workers: int) -> Engine[T, R]:
    """Return an engine of `workers` processes on this machine.

    Each process has a pool of its own, and one chunk at a time: in a pebble pool of several, one
    that is killed between two tasks, or while it holds their common pipe, is the end of all.
    """
    from pebble import ProcessExpired

    def engine(tasks: Iterator[T]) -> Iterator[list[R]]:
        idle = [_Worker.new(work.prepare) for _ in range(workers)]
        busy: dict[Future[Done[R]], tuple[_Worker, list[T]]] = {}
        waiting: deque[T] = deque()
        again: deque[list[T]] = deque()
        results: list[R] = []
        size, broken = chunks.FIRST, 0
        try:
            while True:
                while idle and (again or waiting):
                    chunk = again.popleft() if again else _first(waiting, size)
                    worker, future = idle.pop().sent(work, chunk)
                    busy[future] = worker, chunk
                # The workers are busy: time to tell what came of the last chunk, and to look on.
                if results:
                    yield results
                    results = []
                waiting.extend(islice(tasks, max(0, workers * size - len(waiting))))
                if idle and waiting:
                    continue
                if not busy:
                    return
                for future in _ended({future: worker.pool for future, (worker, _) in busy.items()}):
                    worker, chunk = busy.pop(future)
                    idle.append(worker)
                    lost: BaseException
                    try:
                        done = future.result()
                    except (TimeoutError, ProcessExpired) as error:
                        lost = error
                    except BrokenProcessPool as error:
                        # So it is called too where a process dies before its pool has read that it
                        # has the chunk: which task it was at is known all the same.
                        lost, idle[-1] = error, worker.replaced(work.prepare)
                    else:
                        results += done.results
                        if left := chunk[len(done.results) :]:
                            again.append(left)
                        size, broken = done.next_size, 0
                        continue
                    number = worker.current.value
                    if number == NO_TASK:
                        broken += 1
                        if broken == MOST_BROKEN:
                            text = f"{broken} workers ended one after the other outside any task"
                            raise WorkerDied(text) from lost
                        again.append(chunk)
                        continue
                    # Those before it were done, but nobody was told: they give the same again.
                    if rest := chunk[:number] + chunk[number + 1 :]:
                        again.append(rest)
                    if retry := work.again(chunk[number]):
                        again.append([retry])
                    else:
                        results.append(work.given_up(chunk[number], late=_late(lost)))
        finally:
            pools = [worker.pool for worker in (*idle, *(worker for worker, _ in busy.values()))]
            for pool in pools:
                pool.stop()
            for pool in pools:
                pool.join()

    return engine


@dataclass(frozen=True)
class _Worker:
    """A process, in a pool of its own that starts it anew, and the task that it says it is at."""

    pool: ProcessPool
    current: Any

    @classmethod
    def new(cls, prepare: Callable[[], None]) -> _Worker:
        from pebble import ProcessPool

        context = multiprocessing.get_context("spawn")
        current = context.RawValue("l", NO_TASK)
        pool = ProcessPool(1, initializer=_begin, initargs=(current, prepare), context=context)
        return cls(pool, current)

    def sent(self, work: Work[T, R], chunk: list[T]) -> tuple[_Worker, Future[Done[R]]]:
        """Send a chunk; the worker is another where this one's process died while idle."""
        self.current.value = NO_TASK
        longest = None if work.seconds is None else work.seconds + chunks.SECONDS + GRACE_SECONDS
        arguments = work.job, chunk, work.seconds
        try:
            # The first call starts a process, and the thread that will start others in its place.
            with no_interrupt():
                return self, self.pool.schedule(_do, args=arguments, timeout=longest)
        except RuntimeError:
            return self.replaced(work.prepare).sent(work, chunk)

    def replaced(self, prepare: Callable[[], None]) -> _Worker:
        """Return another one, in place of one whose pool has ended."""
        self.pool.stop()
        self.pool.join()
        return _Worker.new(prepare)


def _begin(current: Any, prepare: Callable[[], None]) -> None:
    """Set up a process: one thread, since the files are the parallelism."""
    os.environ["OMP_NUM_THREADS"] = "1"
    end_with_parent()
    _current.set(current)
    prepare()


def _do(job: Callable[[T], R], tasks: list[T], seconds: float | None) -> Done[R]:
    current = _current.get()

    def begins(number: int | None) -> None:
        current.value = NO_TASK if number is None else number

    return chunks.do(job, tasks, seconds, begins)


def _ended(pools: Mapping[Future[R], ProcessPool]) -> set[Future[R]]:
    """Wait for calls to end, at least one; return those that have.

    A pool whose process dies before it is ready may end without a word about what it was given.
    """
    silent: set[Future[R]] = set()
    while not (ended := wait(pools, LOOK_SECONDS, FIRST_COMPLETED).done):
        for future in silent:
            future.set_exception(BrokenProcessPool("the pool has ended"))
        # Not at once: what is told of an end is told soon after it.
        silent = {future for future, pool in pools.items() if not pool.active}
    return ended


def _first(waiting: deque[T], size: int) -> list[T]:
    return [waiting.popleft() for _ in range(min(size, len(waiting)))]


def _late(lost: BaseException) -> bool:
    """Return whether a process was ended because its task took too long."""
    return isinstance(lost, TimeoutError) or getattr(lost, "exitcode", 0) == -signal.SIGALRM
