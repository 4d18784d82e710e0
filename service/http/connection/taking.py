"""How a client takes its answer: at a least rate, or not at all."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from math import inf

from .outlet import Outlet
from .pace import Pace

log = logging.getLogger("pns.connection")

# How often a client that takes its answer slowly is looked at.
TICK_SECONDS = 0.5


class Taking:
    """Watches what leaves an outlet while it is full; `late` is called where the pace is not kept.

    Only the time in which the client has more to take than it takes is counted.
    """

    def __init__(self, outlet: Outlet, pace: Pace, late: Callable[[], None]) -> None:
        self._outlet = outlet
        self._pace = pace
        self._late = late
        self._clock = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._waited = 0.0
        self._full_since = 0.0
        self._moved = (0, 0.0)
        self._from = 0

    @property
    def waits(self) -> bool:
        """Whether the client has more to take than it takes."""
        return self._timer is not None

    def rate(self, early: float) -> float:
        """Return the bytes a second of those waited for; infinite before `early` seconds."""
        moved, waited = self._progress(self._clock.time())
        return moved / waited if waited > early else inf

    def begin(self) -> None:
        """Begin another answer."""
        self._waited, self._from = 0.0, self._outlet.taken

    def fall_behind(self) -> None:
        """Start the client's clock: the outlet is full."""
        self._full_since = self._clock.time()
        self._moved = (self._outlet.taken, self._full_since)
        self._timer = self._clock.call_later(TICK_SECONDS, self._look)

    def catch_up(self) -> None:
        """Stop the client's clock: the outlet has room, though it may have come too late."""
        if self._timer is not None:
            self.forget()
            moved, self._waited = self._progress(self._clock.time())
            if self._pace.patience(moved, self._waited) <= 0:
                self._end(moved, self._waited)

    def forget(self) -> None:
        """Watch nobody any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _look(self) -> None:
        now, taken = self._clock.time(), self._outlet.taken
        if taken > self._moved[0]:
            self._moved = (taken, now)
        moved, waited = self._progress(now)
        if now - self._moved[1] >= self._pace.idle or self._pace.patience(moved, waited) <= 0:
            self._end(moved, waited)
        else:
            self._timer = self._clock.call_later(TICK_SECONDS, self._look)

    def _end(self, moved: int, waited: float) -> None:
        log.warning("an answer is cut off: %s", self._pace.excuse(moved, waited))
        self._late()

    def _progress(self, now: float) -> tuple[int, float]:
        """Return the bytes that this client took of its answer, and the seconds of waiting."""
        return self._outlet.taken - self._from, self._waited + now - self._full_since
