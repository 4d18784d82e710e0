"""Measure the machine's speed at this moment, for ratios that survive a busy hour."""

from __future__ import annotations

import time

import numpy as np

MIB = 2**20


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


def numpy_second(faces: int = 80_000) -> float:
    """Return the seconds of a sort and some gathers of numpy, of as many rows as faces."""
    rng = np.random.default_rng(0)
    keys, rows = rng.integers(0, 2**40, 3 * faces), rng.standard_normal((faces, 3))
    index = rng.integers(0, faces, 3 * faces)
    start = time.perf_counter()
    np.sort(keys)
    for _ in range(4):
        np.take(rows, index, axis=0).sum(axis=0)
    return time.perf_counter() - start
