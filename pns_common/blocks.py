"""Work over rows in cache-sized blocks, on several threads, with the same bits for any number."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass

# Rows a block: a dozen (rows, 3) float64 temporaries stay in the second-level cache.
ROWS = 8192
MOST_THREADS = 8


@dataclass(frozen=True)
class Blocks:
    """How to run row-wise work: ``threads`` workers over blocks of ``rows`` rows."""

    threads: int
    rows: int = ROWS

    def run(self, count: int, work: Callable[[slice], None]) -> None:
        """Call ``work`` once for each block of range(count); each writes its own rows."""
        slices = list(self._slices(count))
        if self.threads == 1 or len(slices) < 2:
            for rows in slices:
                work(rows)
            return
        # Each block in the caller's context: numpy's error state is part of it.
        contexts = [copy_context() for _ in slices]
        with ThreadPoolExecutor(self.threads) as pool:
            jobs = [pool.submit(c.run, work, s) for c, s in zip(contexts, slices, strict=True)]
            for job in jobs:
                job.result()

    def count(self, rows: int) -> int:
        """How many blocks ``run`` makes of so many rows."""
        return -(-rows // self.rows)

    def number(self, rows: slice) -> int:
        """Which block it is."""
        return rows.start // self.rows

    def _slices(self, count: int) -> Iterator[slice]:
        for start in range(0, count, self.rows):
            yield slice(start, min(start + self.rows, count))


def available_threads() -> int:
    """The processors that this process may use, up to where memory is the limit."""
    known = hasattr(os, "sched_getaffinity")
    processors = len(os.sched_getaffinity(0)) if known else os.cpu_count() or 1
    return min(processors, MOST_THREADS)
