"""Work over rows in cache-sized blocks, on several threads, with the same bits for any number."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextvars import copy_context
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

from pns_common.base.arrays import Array, namespace
from pns_common.base.processors import current_processor, leave

T = TypeVar("T")

# Rows a block: a dozen (rows, 3) float64 temporaries stay in the second-level cache.
BLOCK_ROWS = 8192
MOST_THREADS = 8


def nobody_listens(rows: int) -> None:
    """Do nothing with what is told of blocks."""


@dataclass(frozen=True)
class Blocks:
    """How to run row-wise work: ``threads`` workers over even blocks of at most ``rows`` rows.

    ``before`` is called with the number of rows of each block before it is begun, from whichever
    thread that is; what it raises ends the work. Where there is less to do than two blocks for each
    thread, blocks are smaller, but of ``least`` rows; None: they never are.
    """

    threads: int
    rows: int = BLOCK_ROWS
    before: Callable[[int], None] = nobody_listens
    least: int | None = None

    def of_rows(self, rows: int) -> Blocks:
        """Return the same with blocks of another size, whatever there is to do."""
        return Blocks(self.threads, rows, self.before)

    def rows_of(self, count: int) -> int:
        """Return how many rows a block has where there are so many in all: the last one's fewer."""
        enough = 1 if self.least is None else min(2 * self.threads, count // self.least)
        return max(1, -(-count // max(1, enough, -(-count // self.rows))))

    def count(self, rows: int) -> int:
        """Return how many blocks ``run`` makes of so many rows."""
        return -(-rows // self.rows_of(rows))

    def unheard(self) -> Blocks:
        """Return the same for work after the end, of which nobody is told."""
        return Blocks(self.threads, self.rows, least=self.least)

    def run(self, count: int, work: Callable[[slice], None]) -> None:
        """Call ``work`` once for each block of range(count); each writes its own rows."""
        if 0 < count <= self.rows_of(count):
            # As most of a small mesh: all else takes as long as its work.
            self._begin(work, slice(0, count))
            return
        slices = deque(self._slices(count))

        def following() -> slice | None:
            try:
                return slices.popleft()
            except IndexError:  # another thread took the last
                return None

        def drain() -> None:
            try:
                while rows := following():
                    self._begin(work, rows)
            except BaseException:
                slices.clear()  # nobody waits for the rest
                raise

        helpers = min(self.threads, len(slices)) - 1
        if helpers < 1:
            drain()
            return
        here, begun = current_processor(), list[int]()

        def help_out(helper: int) -> None:
            leave(here)
            begun.append(helper)
            drain()

        # Each helper in the caller's context: numpy's error state is part of it.
        pool = _pool(self.threads - 1)
        jobs = [pool.submit(copy_context().run, help_out, helper) for helper in range(helpers)]
        try:
            drain()
        finally:
            # Who has not begun has nothing left to do, and takes as long to wake up as a block.
            for job in jobs:
                job.cancel()
            running = [jobs[helper] for helper in begun]
            wait(running)
        for job in running:
            job.result()

    def _begin(self, work: Callable[[slice], T], rows: slice) -> T:
        self.before(rows.stop - rows.start)
        return work(rows)

    def gather(self, count: int, work: Callable[[slice], tuple[Array, ...]]) -> tuple[Array, ...]:
        """Return the arrays whose rows ``work`` makes block by block, joined in order.

        It is called for no rows where there are none.
        """
        if self.count(count) < 2:
            return self._begin(work, slice(0, count))
        parts: list[tuple[Array, ...]] = [()] * self.count(count)

        def keep(rows: slice) -> None:
            parts[self.number(rows, count)] = work(rows)

        self.run(count, keep)
        return tuple(namespace(*pieces).concat(pieces) for pieces in zip(*parts, strict=True))

    def number(self, rows: slice, count: int) -> int:
        """Return which block of ``count`` rows it is."""
        return rows.start // self.rows_of(count)

    def _slices(self, count: int) -> Iterator[slice]:
        rows = self.rows_of(count)
        for start in range(0, count, rows):
            yield slice(start, min(start + rows, count))


@cache
def _pool(helpers: int) -> ThreadPoolExecutor:
    """Start threads that wait for work beside the caller: starting takes as long as a block."""
    return ThreadPoolExecutor(helpers, thread_name_prefix="pns")


if hasattr(os, "register_at_fork"):
    # A forked child has the pools, but not their threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)


def available_threads() -> int:
    """Return the processors that this process may use, up to where memory is the limit.

    OMP_NUM_THREADS, where it is set, is a bound here as it is for the libraries below.
    """
    known = hasattr(os, "sched_getaffinity")
    processors = len(os.sched_getaffinity(0)) if known else os.cpu_count() or 1
    bound = os.environ.get("OMP_NUM_THREADS", "")
    most = int(bound) if bound.isdecimal() and int(bound) > 0 else MOST_THREADS
    return min(processors, most, MOST_THREADS)


# For arrays that keep a gradient: all rows at once.
WHOLE = Blocks(threads=1, rows=2**62)
