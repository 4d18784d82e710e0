"""Which processor a thread runs on.

Linux may wake a thread on the processor of the one that woke it, however idle the others are: in a
virtual machine those count as busy while they are halted. Both threads then take turns for some ten
milliseconds, as long as a refinement may take.
"""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from functools import cache
from typing import Any


@cache
def _of_this_thread() -> Any:
    """Return C's ``sched_getcpu``; None where there is none, or nothing to do with its answer."""
    if not hasattr(os, "sched_setaffinity"):
        return None
    # It keeps the GIL: it is over before another thread could have it.
    return getattr(ctypes.PyDLL(None), "sched_getcpu", None)


def current_processor() -> int:
    """Return the number of this thread's processor; −1 where it is not known."""
    ask = _of_this_thread()
    return -1 if ask is None else int(ask())


def leave(processor: int) -> None:
    """Move this thread to another processor if it is on this one; it may come back later."""
    if processor < 0 or current_processor() != processor:
        return
    allowed = os.sched_getaffinity(0)
    # A sandbox may forbid it.
    with suppress(OSError):
        os.sched_setaffinity(0, allowed - {processor} or allowed)
        os.sched_setaffinity(0, allowed)
