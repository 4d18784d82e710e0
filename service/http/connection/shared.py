"""What the connections of one server share: bounds, a crowd, turns, and a buffer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from .crowd import Crowd
from .pace import Pace
from .turns import Turns

# One read of a socket. asyncio's own reads are four times as long, and each connection may hold
# two: one parsed, one that waits.
READ_BYTES = 64 * 1024


@dataclass(frozen=True)
class Bounds:
    """What one connection may take: seconds and bytes.

    `head_seconds` for a request line and its headers, from the first byte on or from the
    connection; `answer` for the client to take what is written; `linger_seconds` for a client that
    still sends after its answer, and `body_bytes` for all that it sends, before and after.
    """

    head_seconds: float
    answer: Pace
    linger_seconds: float
    body_bytes: int


@dataclass
class Shared:
    """What the connections of one server have in common.

    `drains` tells whether the server is about to end: no connection is kept then after its answer.
    """

    bounds: Bounds
    crowd: Crowd
    drains: Callable[[], bool]
    turns: Turns = field(default_factory=Turns)
    # Filled and emptied within one callback, so one is enough for all.
    buffer: bytearray = field(default_factory=lambda: bytearray(READ_BYTES))
