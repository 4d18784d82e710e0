"""Runs that are stopped, by Ctrl-C, SIGTERM or a terminal that closes: they end in order, and say
how to go on."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from rich.console import Console

# Windows has no SIGHUP.
_STOPS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def stoppable(console: Console) -> Iterator[None]:
    """Let what is inside end in order where it is stopped: workers, reports, temporary files."""
    before = {number: signal.getsignal(number) for number in _STOPS}
    for number, handler in before.items():
        # Whoever was started by nohup goes on.
        if handler is not signal.SIG_IGN:
            signal.signal(number, _stop)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        # The terminal may be gone.
        with suppress(OSError):
            console.print("stopped; the same command goes on from here")
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _stop(number: int, _: FrameType | None) -> None:
    raise SystemExit(128 + number)
