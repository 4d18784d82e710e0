"""The operator in compiled kernels: the bits of the array kernels, several times as fast.

numba compiles them once (compiler.py); llvmlite alone loads what it made (library.py), and is not
loaded before that pays: until then the array kernels serve, as they do without numba or a folder to
keep code in. ``python -m pns_common.fused`` compiles all kernels.

Above kernels/ stand levels/, a level as they see it and Loop's step of it; learned/, what learned
rules add to that; where_loaded/, what others ask for by itself; and refine.py, all levels.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec

from pns_common.base.blocks import Blocks, nobody_listens
from pns_common.fused.storage import cache_folder, kernels_are_kept

# Rows a block: a kernel has no temporaries that must stay in a cache, and each call costs a little.
KERNEL_ROWS = 32768
# Fewer where each thread is to have some, but no fewer than this: another thread starts some 50 µs
# late, is waited for as long, and outside kernels has to share the interpreter with this one.
LEAST_KERNEL_ROWS = 16384
LARGEST_INDEX = 2**31 - 1
# What the array kernels do in the time that loading these takes, in faces that Loop makes; and what
# a level costs them before its first face. Measured on meshes of 24 to 80,000 faces. Compiling
# takes a hundred times as long, but once for all processes: some of that has to be this one's.
COST_TO_LOAD, COST_TO_COMPILE = 250_000, 2_000_000
COST_OF_LEVEL = 2_000
LIBRARY = "pns_common.fused.library"


@dataclass
class _Work:
    """What a process has done while the kernels were not loaded."""

    cost: int = 0


_work = _Work()


@cache
def kernels_available() -> bool:
    """Return whether kernels can be compiled here, and kept.

    Not on Windows, where calls and object files are of another kind: nobody has run them there.
    """
    return sys.platform != "win32" and find_spec("numba") is not None and cache_folder() is not None


def load_kernels() -> bool:
    """Load the kernels now, as a process that lives long does at its start; False without numba."""
    if not kernels_available():
        return False
    import_module(LIBRARY).library()
    for learned_or_not in ("refine", "learned.learned_step", "where_loaded.extent"):
        import_module(f"{__name__}.{learned_or_not}")
    return True


def kernels_loaded() -> bool:
    """Return whether they are loaded."""
    return LIBRARY in sys.modules


def kernels_pay(costs: Sequence[int]) -> bool:
    """Return whether kernels are to be used for levels of such costs: loaded, or paid for now."""
    if kernels_loaded():
        return True
    _work.cost += sum(costs) + len(costs) * COST_OF_LEVEL
    return _work.cost >= (COST_TO_LOAD if kernels_are_kept() else COST_TO_COMPILE)


def kernel_blocks(threads: int, before: Callable[[int], None] = nobody_listens) -> Blocks:
    """Return how kernels' rows are divided; ``before`` as ``Blocks`` has it."""
    return Blocks(threads, KERNEL_ROWS, before, LEAST_KERNEL_ROWS)


def fits(vertex_count: int, face_count: int, levels: int) -> bool:
    """Return whether so many levels can be numbered in int32.

    The largest numbers are the half-edges that the last level makes, 12 a face that it splits; no
    more vertices than that are added on the way.
    """
    return vertex_count + 12 * face_count * 4 ** (levels - 1) <= LARGEST_INDEX
