"""End processes: workers with the process that started them, and not by Ctrl-C."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

# What a terminal sends to the workers of a process too: Ctrl-C, and that it closes.
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


def end_with_parent() -> None:
    """End this process once the one that started it has ended, in whatever way, also inside a job.

    One that is killed tells nobody; what it had begun would run on, beside the next one's.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:

        def end() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=end, daemon=True).start()
