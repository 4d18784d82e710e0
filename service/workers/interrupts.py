"""Signals that a terminal sends to the workers of a process too: Ctrl-C, and that it closes."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

OF_TERMINAL = {signal.SIGINT, signal.SIGHUP}


@contextmanager
def no_interrupt() -> Iterator[None]:
    """Keep these from threads and processes that are started inside: to end them is for whoever
    starts them, and one that is still importing would say so at length."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, OF_TERMINAL)
    try:
        # Python's own, which counts locks and is started with the first, lets Ctrl-C through.
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, OF_TERMINAL)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
