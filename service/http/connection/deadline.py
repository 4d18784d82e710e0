"""What a connection must have done by then, or an end is made of it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable


class Deadline:
    """One clock: `late` is called unless it is stopped in time. It runs once at a time."""

    def __init__(self, loop: asyncio.AbstractEventLoop, late: Callable[[], None]) -> None:
        self._loop = loop
        self._late = late
        self._timer: asyncio.TimerHandle | None = None

    def start(self, seconds: float) -> None:
        """Let it run, where it does not yet."""
        if self._timer is None:
            self._timer = self._loop.call_later(seconds, self._come)

    def stop(self) -> None:
        """Let it not come; it may be started again."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _come(self) -> None:
        self._timer = None
        self._late()
