"""uvicorn's server, which ends connections that ask for nothing."""

from __future__ import annotations

import asyncio
import socket
from contextlib import AbstractContextManager, nullcontext

import uvicorn


class PromptServer(uvicorn.Server):
    """A server without signal handlers, whose idle connections end in time.

    A connection is idle while it has no request under way: nothing was sent, or half a head, or it
    rests after an answer. It ends `head_seconds` later; where there are more than `most`
    connections, those that are idle for longest end at once.
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
        # By connection: its requests so far are not counted, only since when it is idle.
        self._idle_since: dict[object, float] = {}

    def capture_signals(self) -> AbstractContextManager[None]:
        """Leave the signals to another server of this process."""
        return nullcontext()

    async def serve(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve on the sockets that it was made with, or as its configuration says."""
        await super().serve(sockets or self._listening)

    async def on_tick(self, counter: int) -> bool:
        """End idle connections, ten times a second."""
        self._end_idle(asyncio.get_running_loop().time())
        return await super().on_tick(counter)

    def _end_idle(self, now: float) -> None:
        connections = self.server_state.connections
        idle = {
            connection: self._idle_since.get(connection, now)
            for connection in connections
            if (cycle := getattr(connection, "cycle", None)) is None or cycle.response_complete
        }
        self._idle_since = dict(sorted(idle.items(), key=lambda item: item[1]))
        too_many = len(connections) - self._most
        for number, (connection, since) in enumerate(self._idle_since.items()):
            # One that has just come may have sent its head.
            gives_way = number < too_many and since < now
            if gives_way or now - since >= self._head_seconds:
                connection.transport.close()
