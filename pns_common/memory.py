"""How much memory there is, for work that says beforehand what it takes."""

from __future__ import annotations

import os
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
