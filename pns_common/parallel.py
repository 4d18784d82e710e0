"""Share row-wise work among threads, with the same bits for any number of them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass
from functools import cache
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

BLOCK_ROWS = 32_768
LEAST_ROWS = 16_384
MOST_THREADS = 8


def no_progress(rows: int) -> None:
    """Do nothing: no-op progress reporter."""


@dataclass(frozen=True)
class Blocks:
    """Division of row-wise work: worker threads, and blocks of rows.

    Attributes:
        threads: workers, the calling thread among them.
        before: called with the number of rows before each block, from any worker; an exception
            that it raises ends the work and reaches the caller.
        rows: rows of a block. None: about two blocks a thread, of LEAST_ROWS to BLOCK_ROWS rows.
    """

    threads: int = 1
    before: Callable[[int], None] = no_progress
    rows: int | None = None

    def quiet(self) -> Blocks:
        """Return a copy without the progress callback."""
        return self if self.before is no_progress else Blocks(self.threads, rows=self.rows)

    def of_rows(self, rows: int) -> Blocks:
        """Return a copy with blocks of a fixed number of rows."""
        return Blocks(self.threads, self.before, rows)

    def owners(self, count: int) -> Blocks:
        """Return a copy with at most one block a thread, for loops that read all edges each."""
        blocks = max(1, min(self.threads, count // LEAST_ROWS))
        return self.of_rows(max(1, -(-count // blocks)))

    def slices(self, count: int) -> list[slice]:
        """Return the blocks of ``count`` rows."""
        rows = self.rows
        if rows is None:
            blocks = max(1, min(2 * self.threads, count // LEAST_ROWS), -(-count // BLOCK_ROWS))
            rows = max(1, -(-count // blocks))
        return [slice(start, min(start + rows, count)) for start in range(0, count, rows)]

    def run(
        self,
        count: int,
        work: Callable[Concatenate[int, int, P], T],
        *given: P.args,
        **named: P.kwargs,
    ) -> list[T]:
        """Call ``work(begin, end, *given)`` for each block of rows; return results in order."""
        if 0 < count <= (self.rows or LEAST_ROWS):
            # One block: all else would take as long as its work, in a small mesh.
            self.before(count)
            return [work(0, count, *given, **named)]
        slices = self.slices(count)
        results: list[Any] = [None] * len(slices)
        waiting = deque(enumerate(slices))

        def drain() -> None:
            try:
                for number, rows in _taken(waiting):
                    self.before(rows.stop - rows.start)
                    results[number] = work(rows.start, rows.stop, *given, **named)
            except BaseException:
                waiting.clear()
                raise

        helpers = min(self.threads, len(slices)) - 1
        if helpers < 1:
            drain()
            return results
        # In the caller's context: numpy's error state is part of it.
        pool = _pool(self.threads - 1)
        jobs = [pool.submit(copy_context().run, drain) for _ in range(helpers)]
        try:
            drain()
        finally:
            # A helper that has not begun has nothing left to do.
            begun = [job for job in jobs if not job.cancel()]
            failures = [error for job in begun if (error := job.exception())]
        if failures:
            raise failures[0]
        return results


def _taken(waiting: deque[tuple[int, slice]]) -> Iterator[tuple[int, slice]]:
    """Yield what is left, until another thread has taken the last."""
    while True:
        try:
            yield waiting.popleft()
        except IndexError:
            return


@cache
def _pool(helpers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(helpers, thread_name_prefix="pns")


if hasattr(os, "register_at_fork"):
    # A forked child has the pools, but not their threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)


def available_threads() -> int:
    """Return the processors that this process may use, 8 at most; OMP_NUM_THREADS is a bound."""
    known = hasattr(os, "sched_getaffinity")
    processors = len(os.sched_getaffinity(0)) if known else os.cpu_count() or 1
    bound = os.environ.get("OMP_NUM_THREADS", "")
    most = int(bound) if bound.isdecimal() and int(bound) > 0 else MOST_THREADS
    return min(processors, most, MOST_THREADS)
