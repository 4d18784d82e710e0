"""The writing side of a connection: what the client has taken, and an end that lets it read."""

from __future__ import annotations

import asyncio
import select
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any

# Whether the system tells that a client has ended before all it said is read (Linux does).
TELLS_END = hasattr(select, "POLLRDHUP")
# Whether a look at what waits can be told not to wait itself (Windows has no such flag).
DOES_NOT_WAIT: int | None = getattr(socket, "MSG_DONTWAIT", None)
# What the system takes of an answer before it is on its way. Without a bound it takes megabytes for
# a client that reads nothing, in memory that nobody here counts, and keeps them for minutes after
# the connection has ended.
UNSENT_BYTES = 64 * 1024
_UNSENT: int | None = getattr(socket, "TCP_NOTSENT_LOWAT", None)
_UNTAKEN: int | None = getattr(socket, "TCP_USER_TIMEOUT", None)
# The most milliseconds that the system counts: three weeks and a half.
_MOST = 2**31 - 1


class Outlet:
    """A transport that counts what is written and leaves the manner of closing to `end`.

    uvicorn closes a connection when the answer is written. Where the client is still sending, the
    system then drops what it has not read and resets the connection, and the client never sees why.
    """

    def __init__(self, transport: asyncio.Transport, end: Callable[[], None]) -> None:
        self.real = transport
        self._end = end
        self._closing = False
        self._written = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real, name)

    def keep_little(self, seconds: float) -> None:
        """Let the system hold little of what is written, and for so long where none is taken.

        Where it knows of no such bounds it has its own.
        """
        connection = self.real.get_extra_info("socket")
        untaken = max(1, round(min(1000 * seconds, _MOST)))
        for option, value in (_UNSENT, UNSENT_BYTES), (_UNTAKEN, untaken):
            if option is not None:
                # Reset already, or no TCP.
                with suppress(OSError):
                    connection.setsockopt(socket.IPPROTO_TCP, option, value)

    @property
    def taken(self) -> int:
        """Bytes that have left for the client."""
        return self._written - self.real.get_write_buffer_size()

    @property
    def has_unread(self) -> bool:
        """Whether bytes of the client wait in the socket; not those of one who has only left.

        False where the system cannot look without waiting.
        """
        if DOES_NOT_WAIT is None:
            return False
        # Not a copy: there may be no descriptor for one.
        same = socket.socket(fileno=self.real.get_extra_info("socket").fileno())
        try:
            return same.recv(1, socket.MSG_PEEK | DOES_NOT_WAIT) != b""
        except OSError:  # nothing yet, or reset
            return False
        finally:
            same.detach()

    @property
    def has_left(self) -> bool:
        """Whether the client has ended what it sends, also behind bytes that wait to be read.

        False where the system does not tell.
        """
        if not TELLS_END:
            return False
        looked = select.poll()
        # An error is told unasked.
        looked.register(self.real.get_extra_info("socket").fileno(), select.POLLRDHUP)
        return bool(looked.poll(0))

    def write(self, data: bytes) -> None:
        """Write, unless the end has begun."""
        if not self._closing:
            self._written += len(data)
            self.real.write(data)

    def is_closing(self) -> bool:
        """Return whether the end has begun."""
        return self._closing or self.real.is_closing()

    def close(self) -> None:
        """Begin the end, once."""
        if not self._closing:
            self._closing = True
            self._end()

    def forget(self) -> None:
        """Do nothing at a close any more: there is nothing left to close."""
        self._closing = True
