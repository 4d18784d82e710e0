"""Memory that a call frees stays with the process for the next one, up to 128 MiB a thread.

glibc gives memory back to the system as soon as the free end of its heap is larger than a bound,
128 KiB at first, and then each call's tables are new pages again, which the system clears: a third
of three levels from 20,000 faces. It takes blocks above another bound from the system each time,
and gives them back; that one grows by itself, up to 32 MiB, and has to be set too, or setting the
first would stop it.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from functools import cache

# What three levels from 20,000 faces free, and one from 320,000, closed or open and in any order:
# less, and their pages are new ones each time. Before large results all of it goes back
# (``make_room``).
KEPT = 128 * 2**20
# glibc takes larger blocks from the system each time, whatever it has kept; it allows no more.
LARGEST_KEPT = 32 * 2**20
# Whoever has set one of these has had his reasons.
OF_THE_ENVIRONMENT = "GLIBC_TUNABLES", "MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_"
# Of glibc's malloc.h.
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3


def keep_freed_memory() -> None:
    """Let the allocator keep what this process frees; where it is not glibc's nothing changes.

    Nor where the environment has a word to say of it.
    """
    if not any(name in os.environ for name in OF_THE_ENVIRONMENT):
        set_option = _of_glibc("mallopt")
        set_option(MMAP_THRESHOLD, LARGEST_KEPT)
        set_option(TRIM_THRESHOLD, KEPT)


def make_room(size: int) -> None:
    """Give all that is freed back to the system, before so many bytes are written.

    Only where they cannot be taken of that: a fifth of the peak at 1.3 million faces.
    """
    if size > LARGEST_KEPT:
        give_back()


def give_back() -> None:
    """Give all that is freed back to the system."""
    _of_glibc("malloc_trim")(0)


@cache
def _of_glibc(name: str) -> Callable[..., object]:
    """Return a function of glibc; where it is not there what does nothing."""
    found = getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
    return found or _nothing


def _nothing(*arguments: int) -> None:
    """Do nothing."""
