"""Runs that are stopped, by Ctrl-C or by SIGTERM: they end in order, and say how to go on."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from rich.console import Console


@contextmanager
def stoppable(console: Console) -> Iterator[None]:
    """Let what is inside end in order where it is stopped: workers, reports, temporary files."""
    before = signal.signal(signal.SIGTERM, _stop)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        console.print("stopped; the same command goes on from here")
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def _stop(number: int, _: FrameType | None) -> None:
    raise SystemExit(128 + number)
