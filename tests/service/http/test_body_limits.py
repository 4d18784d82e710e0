"""Bodies on their way: who sends slowly is waited for as long as the pace allows, and no longer."""

from __future__ import annotations

import asyncio

import pytest
from starlette.types import Message, Receive, Scope, Send

from service.errors import LimitError
from service.http.body_limits import BodyLimit, Pace, UploadTimeoutError

# So many bytes a second, but for the first fifth of one.
PACE = Pace(rate=1e6, grace=0.2, idle=60, whole=60)
PIECES = 100


def take(every: float, work: float = 0.0, max_bytes: int = 10**6) -> int:
    """Take a body that comes byte by byte, with work in between; return how many came."""
    taken = 0

    async def arrives() -> Message:
        await asyncio.sleep(every)
        return {"type": "http.request", "body": b"x", "more_body": taken + 1 < PIECES}

    async def app(_: Scope, receive: Receive, __: Send) -> None:
        nonlocal taken
        while (await receive())["more_body"]:
            taken += 1
            await asyncio.sleep(work)
        taken += 1

    async def nothing(_: Message) -> None: ...

    layer = BodyLimit(app, max_bytes=max_bytes, pace=PACE)
    asyncio.run(layer({"type": "http", "headers": []}, arrives, nothing))
    return taken


def test_a_body_that_trickles_is_cut_off_though_it_is_never_idle() -> None:
    with pytest.raises(UploadTimeoutError, match="slower than"):
        take(every=0.02)


def test_the_time_that_is_taken_for_its_pieces_is_not_the_clients() -> None:
    assert take(every=0, work=0.003) == PIECES


def test_a_body_of_no_announced_length_is_counted_as_it_comes() -> None:
    assert take(every=0, max_bytes=PIECES) == PIECES
    with pytest.raises(LimitError, match="the body has 100 bytes or more"):
        take(every=0, max_bytes=PIECES - 1)
