"""The operator in compiled kernels: the bits of the array kernels, several times as fast.

Needs numba and a folder for its cache; without them the array kernels serve. Nothing else here is
loaded before it is needed: reading the kernels takes as long as the array kernels take for a
million faces, so these serve until that pays. ``python -m pns_common.fused`` compiles all kernels.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec

from pns_common.fused.storage import cache_folder

# Rows a block: a kernel has no temporaries that must stay in a cache, and each call costs a little.
KERNEL_ROWS = 32768
LARGEST_INDEX = 2**31 - 1
# What the array kernels do in the time that reading these takes, in faces that Loop makes; and what
# a level costs them before its first face. Measured on single meshes of 16 to 2,000,000 faces.
COST_TO_LOAD = 2_000_000
COST_OF_LEVEL = 2_000
LOADED = "pns_common.fused.refine"


@dataclass
class _Work:
    """What a process has done while the kernels were not loaded."""

    cost: int = 0


_work = _Work()


@cache
def kernels_available() -> bool:
    """Whether kernels can be compiled here, and kept."""
    return find_spec("numba") is not None and cache_folder() is not None


def load_kernels() -> bool:
    """Load the kernels now, as a process that lives long does at its start; False without numba."""
    if not kernels_available():
        return False
    import_module(LOADED)
    import_module("pns_common.fused.learned_step")

    return True


def kernels_loaded() -> bool:
    """Whether they are loaded."""
    return LOADED in sys.modules


def kernels_pay(costs: Sequence[int]) -> bool:
    """Whether to use the kernels for levels of such costs: they are loaded, or pay for that now."""
    if kernels_loaded():
        return True
    _work.cost += sum(costs) + len(costs) * COST_OF_LEVEL
    return _work.cost >= COST_TO_LOAD


def fits(vertex_count: int, face_count: int, levels: int) -> bool:
    """Whether so many levels can be numbered in int32.

    The largest numbers are the half-edges that the last level makes, 12 a face that it splits; no
    more vertices than that are added on the way.
    """
    return vertex_count + 12 * face_count * 4 ** (levels - 1) <= LARGEST_INDEX
