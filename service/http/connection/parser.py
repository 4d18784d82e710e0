"""h11's connection, which stops for breath and counts the pieces of a body."""

from __future__ import annotations

import re
from typing import Any

import h11

from .strict import check_lines, check_request, is_chunked
from .target import origin_form

# A body of n bytes may come in this many chunks, and one more for each so many bytes: each costs
# the event loop as much as a kilobyte does, however small it is.
FREE_PIECES = 256
BYTES_A_PIECE = 512
# Name of the ASGI extension that tells whether a request's body has passed them: a function.
FLOODED = "pns.flooded"
# Errors end with the bytes that they are about: these may be a key, and are for nobody's log.
_QUOTED = re.compile(r":? b(ytearray\(b)?['\"].*", re.DOTALL)


class Parser(h11.Connection):
    """Hands out a bounded number of events, then says that it needs data though it has some.

    One read may hold ten thousand one-byte chunks; parsed in one go, they keep every other
    connection waiting.
    """

    def __init__(self, longest_head: int) -> None:
        super().__init__(h11.SERVER, longest_head)
        self.out_of_breath = False
        self.flooded = False
        self.status_hint = 400
        self.complaint = ""
        self._longest_head = longest_head
        self._chunked = False
        self._left = 0
        self._pieces = 0
        self.body_bytes = 0

    def breathe(self, events: int) -> None:
        """Allow that many more events."""
        self._left = events
        self.out_of_breath = False

    def next_event(self) -> Any:
        """Return the next event, or h11.NEED_DATA if the breath is out or the body is a flood."""
        if self.flooded:
            return h11.NEED_DATA
        if self._left <= 0:
            self.out_of_breath = True
            return h11.NEED_DATA
        self._left -= 1
        try:
            event = self._checked_event()
        except h11.RemoteProtocolError as error:
            self.status_hint = error.error_status_hint
            self.complaint = _QUOTED.sub("", str(error))
            raise
        if isinstance(event, h11.Data):
            self._count(event)
        elif isinstance(event, h11.Request):
            self._pieces = self.body_bytes = 0
        return event

    def _checked_event(self) -> Any:
        """Return the next event, if there is but one way to read the lines that it came in."""
        lined = self._chunked or self.their_state is h11.IDLE
        waiting = self.trailing_data[0] if lined else b""
        event = super().next_event()
        if isinstance(event, h11.Request):
            taken = len(waiting) - len(self.trailing_data[0])
            check_request(event, waiting[:taken], self._longest_head)
            self._chunked = is_chunked(event)
            event = origin_form(event)
        elif isinstance(event, h11.EndOfMessage):
            if self._chunked:
                check_lines(waiting[: len(waiting) - len(self.trailing_data[0])])
            self._chunked = False
        return event

    def _count(self, data: h11.Data) -> None:
        self.body_bytes += len(data.data)
        self._pieces += data.chunk_start
        self.flooded = self._pieces > FREE_PIECES + self.body_bytes // BYTES_A_PIECE
