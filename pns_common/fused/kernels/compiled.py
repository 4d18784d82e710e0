"""How kernels of this package are compiled: to plain IEEE arithmetic, once, and without the GIL."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba.core import caching

from pns_common.fused.storage import BUILT, KERNELS, cache_folder, copy_built

# Read-only arrays in: numba takes writable ones there too, so that each kernel is compiled once.
POINTS = numba.types.Array(numba.float64, 2, "C", readonly=True)
INDICES = numba.types.Array(numba.int32, 2, "C", readonly=True)
LONG_INDICES = numba.types.Array(numba.int64, 2, "C", readonly=True)
INDEX = numba.types.Array(numba.int32, 1, "C", readonly=True)
CLASSES = numba.types.Array(numba.int8, 1, "C", readonly=True)
NUMBERS = numba.types.Array(numba.float64, 1, "C", readonly=True)
# Written by a kernel.
POINTS_OUT = numba.float64[:, ::1]
NUMBERS_OUT = numba.float64[::1]
INDICES_OUT = numba.int32[:, ::1]
INDEX_OUT = numba.int32[::1]
LONG_INDICES_OUT = numba.int64[:, ::1]
CLASSES_OUT = numba.int8[::1]
FLAGS = numba.types.Array(numba.boolean, 1, "C", readonly=True)
FLAGS_OUT = numba.boolean[::1]
SIZE = numba.int64
REAL = numba.float64


def _use_cache() -> None:
    """Tell numba where its cache is, with the kernels that came with the package in it."""
    folder = cache_folder()
    if folder is None or folder == BUILT:
        return  # numba's own choice, and there it can write
    numba.config.CACHE_DIR = str(folder)
    # numba's cache has a folder for each folder of sources.
    locator = caching._CacheLocator
    copy_built(BUILT, folder / locator.get_suitable_cache_subpath(str(KERNELS / "edges.py")))


_use_cache()


def kernel(result: Any, *arguments: Any) -> Callable[[Any], Any]:
    """Compile a function for one signature when it is defined, or read it from the cache.

    No fast-math: nothing is reordered or contracted, so a kernel has the bits of the same formula
    in numpy, on any machine.
    """
    return kernels(result, arguments)


def kernels(result: Any, *arguments: Any) -> Callable[[Any], Any]:
    """The same for several signatures, tried in order."""
    signatures = [result(*types) for types in arguments]
    return numba.njit(signatures, nogil=True, cache=True, error_model="numpy")
