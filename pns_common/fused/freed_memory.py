"""Memory that a call frees stays with the process for the next one, up to some 50 MB.

glibc gives memory back to the system as soon as the free end of its heap is larger than twice the
largest block that was ever freed on its own, and then each call's tables are new pages again, which
the system clears: a third of Loop's time at 80,000 faces. That bound grows with what is freed, up
to blocks of 32 MiB. One such block, never written and so never in memory, sets it once for all, as
a call of 320,000 faces would.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache

import numpy as np

# More would save the system's help in calls of more than 100,000 faces too, and costs memory: at
# 1.3 million faces in random order the peak is 440 MiB, 480 with blocks of 31 MiB, 370 with none.
KEPT_BLOCK = 24 * 2**20
# glibc takes larger blocks from the system each time, whatever it has kept.
LARGEST_KEPT = 32 * 2**20


def keep_freed_memory() -> None:
    """Let the allocator keep what this process frees; where it is not glibc's nothing changes."""
    block = np.empty(KEPT_BLOCK, dtype=np.uint8)
    del block


def make_room(size: int) -> None:
    """Give all that is freed back to the system, before so many bytes are written.

    Only where they cannot be taken of that: a fifth of the peak at 1.3 million faces.
    """
    if size > LARGEST_KEPT:
        _trim()(0)


@cache
def _trim() -> Callable[[int], object]:
    """Return glibc's ``malloc_trim``; where there is none what does nothing."""
    found = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    return found or int
