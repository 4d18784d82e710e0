"""Measure the machine's speed at this moment, for ratios that survive a busy hour."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.memory import MIB


def copy_bandwidth(mib: int = 128) -> float:
    """Return the bytes a second that one thread copies, counted once (though read and written)."""
    source = np.ones(mib * MIB // 8)
    target = np.empty_like(source)
    np.copyto(target, source)  # first touch
    start = time.perf_counter()
    np.copyto(target, source)
    return source.nbytes / (time.perf_counter() - start)


def sgemm_rate(size: int = 1024) -> float:
    """Return the operations a second of numpy's single-precision product, all its threads."""
    a = np.ones((size, size), dtype=np.float32)
    a @ a
    start = time.perf_counter()
    a @ a
    return 2 * size**3 / (time.perf_counter() - start)
