"""Ctrl-C, which a terminal sends to the workers of a process too."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker


@contextmanager
def no_interrupt() -> Iterator[None]:
    """Keep Ctrl-C from threads and processes that are started inside: to end them is for whoever
    starts them, and one that is still importing would say so at length."""
    # As it starts, with the first lock of a process's, it lets through what is kept.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
