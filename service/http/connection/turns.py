"""Whose turn it is: connections with more to parse share the event loop in small steps."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

Step = Callable[[], None]


class Turns:
    """A queue of steps, one at each turn of the event loop, first come first served.

    However many connections have work left, a turn costs one step, so that what arrives in between
    (a probe, an answer) waits for one step and not for all.
    """

    def __init__(self) -> None:
        # A dictionary is an ordered set: a step that waits is not queued twice, and can leave.
        self._waiting: dict[Step, None] = {}
        self._scheduled = False

    def add(self, step: Step) -> None:
        """Call `step` when its turn comes."""
        self._waiting[step] = None
        if not self._scheduled:
            self._scheduled = True
            asyncio.get_running_loop().call_soon(self._next)

    def remove(self, step: Step) -> None:
        """Forget a step, where it waits."""
        self._waiting.pop(step, None)

    def _next(self) -> None:
        self._scheduled = False
        step = next(iter(self._waiting), None)
        if step is None:
            return
        del self._waiting[step]
        if self._waiting:
            self._scheduled = True
            asyncio.get_running_loop().call_soon(self._next)
        step()
