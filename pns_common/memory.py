"""Memory: how much there is, and how much of what is freed stays with the process."""

from __future__ import annotations

import ctypes
import os
import sys
from functools import cache
from pathlib import Path

# What a container may take: a number, or "max".
CONTAINER = Path("/sys/fs/cgroup/memory.max")


@cache
def memory_here() -> int | None:
    """Return the bytes that this machine has, or this container; None where it is not known.

    What it can swap does not count.
    """
    try:
        machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None
    try:
        return min(machine, int(CONTAINER.read_text()))
    except (OSError, ValueError):
        return machine


# glibc's malloc.h: options of mallopt, and how much freed memory a process keeps for its next call.
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
KEPT, LARGEST_KEPT = 128 * 2**20, 32 * 2**20


def keep_freed_memory() -> None:
    """Let glibc keep what this process frees, up to 128 MiB; do nothing on other systems.

    By default each call's arrays are new pages, which the system clears: half of a level's time. A
    process whose environment sets malloc's options is left as it is.
    """
    given = ("GLIBC_TUNABLES", "MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_")
    if sys.platform != "linux" or any(name in os.environ for name in given):
        return
    set_option = getattr(ctypes.CDLL(None), "mallopt", None)
    if set_option is not None:
        set_option(MMAP_THRESHOLD, LARGEST_KEPT)
        set_option(TRIM_THRESHOLD, KEPT)
