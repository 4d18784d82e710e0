"""Commands on POSIX systems alone, and runs that are stopped, by Ctrl-C, SIGTERM or a terminal that
closes: they end in order, and say how to go on."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def check_posix(command: str) -> None:
    """Raise StartError where there are no locks, signals and process sessions of POSIX.

    By these workers are ended, and a folder of work is kept from a second run.
    """
    from ..settings import StartError

    if find_spec("fcntl") is None:
        raise StartError(
            f"pns {command} needs a POSIX system: Linux, macOS, or, on Windows, WSL or the "
            "container; pns subdivide needs none"
        )


@contextmanager
def stoppable(console: Console) -> Iterator[None]:
    """Let what is inside end in order where it is stopped: workers, reports, temporary files."""
    on_terminal = console.is_terminal

    def stop(number: int, _: FrameType | None) -> None:
        # A shell tells of a terminal that closes, and the system again once the shell has ended.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        # To draw on one that is gone would fail, in place of the end.
        console.quiet = on_terminal and number == signal.SIGHUP
        raise SystemExit(128 + number)

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number, handler in before.items():
        # Whoever was started by nohup goes on.
        if handler is not signal.SIG_IGN:
            signal.signal(number, stop)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        console.print("stopped; the same command goes on from here")
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
