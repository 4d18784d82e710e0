"""uvicorn's server, which ends connections that ask for nothing."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn


class PromptServer(uvicorn.Server):
    """A server whose idle connections end in time.

    A connection is idle while it has no request under way: nothing was sent, or half a head, or it
    rests after an answer. It ends `head_seconds` later; where there are more than `most`
    connections, those that are idle for longest end at once. One whose client still takes its
    answer is idle once it takes none of it any more.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        head_seconds: float,
        most: int,
        listening: list[socket.socket] | None = None,
    ) -> None:
        super().__init__(config)
        self._listening = listening
        self._head_seconds = head_seconds
        self._most = most
        # By connection: since when it is idle, after which request, and what of its answer its
        # client has not taken yet, in bytes.
        self._idle: dict[Any, tuple[float, Any, int]] = {}

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signals to another server of this process."""
        yield

    async def serve(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve on the sockets that it was made with, or as its configuration says."""
        await super().serve(sockets or self._listening)

    async def on_tick(self, counter: int) -> bool:
        """End idle connections, ten times a second."""
        self._end_idle(asyncio.get_running_loop().time())
        return await super().on_tick(counter)

    def _end_idle(self, now: float) -> None:
        connections = self.server_state.connections
        before, self._idle = self._idle, {}
        for connection in connections:
            # Of the one protocol that is served here.
            cycle: Any = getattr(connection, "cycle", None)
            closing = connection.transport.is_closing()
            if closing or cycle is None or cycle.response_complete:
                untaken = connection.transport.get_write_buffer_size()
                since, last, left = before.get(connection, (now, cycle, untaken))
                rests = last is cycle and left == untaken
                self._idle[connection] = (since if rests else now, cycle, untaken)
        too_many = len(connections) - self._most
        oldest = sorted(self._idle, key=lambda connection: self._idle[connection][0])
        for number, connection in enumerate(oldest):
            waited = now - self._idle[connection][0]
            # One that has just come may have sent its head.
            if waited >= self._head_seconds or (number < too_many and waited > 0):
                connection.transport.abort()
