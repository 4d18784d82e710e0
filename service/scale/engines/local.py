"""Tasks done in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice
from multiprocessing.connection import Connection, wait
from typing import Generic

from ...errors import WorkerDied
from ...workers.worker import end_with_parent, no_interrupt
from . import work as chunks
from .work import Done, Engine, R, T, Work

# Workers that may end in a row while they do no task: so many are not killed by chance.
MOST_BROKEN = 100


def local(work: Work[T, R], workers: int) -> Engine[T, R]:
    """Return an engine of `workers` processes on this machine, each with a chunk at a time."""

    def engine(tasks: Iterator[T]) -> Iterator[list[R]]:
        crew = [_Worker(work) for _ in range(workers)]
        waiting: deque[T] = deque()
        again: deque[list[T]] = deque()
        results: list[R] = []
        size, broken = chunks.FIRST, 0
        try:
            while True:
                for worker in crew:
                    if not worker.chunk and (again or waiting):
                        worker.take(again.popleft() if again else _first(waiting, size))
                # The workers are busy: time to tell what came of the last chunk, and to look on.
                if results:
                    yield results
                    results = []
                waiting.extend(islice(tasks, max(0, workers * size - len(waiting))))
                busy = {worker.pipe: worker for worker in crew if worker.chunk}
                if len(busy) < workers and waiting:
                    continue
                if not busy:
                    return
                for pipe in wait(list(busy)):
                    worker = busy[pipe]  # pyright: ignore[reportArgumentType]
                    done = worker.hear()
                    if done is not None:
                        results += done.results
                        if left := worker.chunk[len(done.results) :]:
                            again.append(left)
                        worker.chunk, size, broken = [], done.next_size, 0
                        continue
                    if worker.lives:
                        continue
                    crew[crew.index(worker)] = _Worker(work)
                    chunk, number = worker.chunk, worker.current
                    if number is None:
                        broken += 1
                        if broken == MOST_BROKEN:
                            text = f"{broken} workers ended one after the other outside any task"
                            raise WorkerDied(text)
                        again.append(chunk)
                        continue
                    # Those before it were done, but nobody was told: they give the same again.
                    if rest := chunk[:number] + chunk[number + 1 :]:
                        again.append(rest)
                    if retry := work.again(chunk[number]):
                        again.append([retry])
                    else:
                        results.append(work.given_up(chunk[number], late=worker.was_late))
        finally:
            for worker in crew:
                worker.process.kill()
            for worker in crew:
                worker.process.join()

    return engine


class _Worker(Generic[T, R]):
    """A process, the chunk that it has, and the task of it that it says it is at."""

    def __init__(self, work: Work[T, R]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        todo = work.prepare, work.job, work.seconds
        self.process = context.Process(target=_serve, args=(other, *todo), daemon=True)
        with no_interrupt():
            self.process.start()
        other.close()
        self.chunk: list[T] = []
        self.current: int | None = None
        self.lives = True

    def take(self, chunk: list[T]) -> None:
        """Begin a chunk; that the process has ended meanwhile is heard next."""
        self.chunk = chunk
        try:
            self.pipe.send(chunk)
        except OSError:
            return

    def hear(self) -> Done[R] | None:
        """Hear what the process says: results, which task it is at, a fault of ours; or its end.

        Raises the fault.
        """
        try:
            said = self.pipe.recv()
        except (EOFError, OSError):
            self.process.join()
            self.pipe.close()
            self.lives = False
            return None
        if isinstance(said, Exception):
            raise said
        if isinstance(said, Done):
            return said
        self.current = said
        return None

    @property
    def was_late(self) -> bool:
        """True where the process was ended because its task took too long."""
        return self.process.exitcode == -signal.SIGALRM


def _serve(
    pipe: Connection, prepare: Callable[[], None], job: Callable[[T], R], seconds: float | None
) -> None:
    """Do chunks until nobody sends any; with one thread, since the files are the parallelism."""
    os.environ["OMP_NUM_THREADS"] = "1"
    end_with_parent()
    prepare()
    while True:
        tasks = pipe.recv()
        try:
            pipe.send(chunks.do(job, tasks, seconds, pipe.send))
        except Exception as error:
            pipe.send(error)


def _first(waiting: deque[T], size: int) -> list[T]:
    return [waiting.popleft() for _ in range(min(size, len(waiting)))]
