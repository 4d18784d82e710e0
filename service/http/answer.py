"""Answers: the bytes that a worker left in a memory file, their type, and clients that leave."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from fastapi import Request
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from ..bodies import media
from ..workers.memory_file import MemoryFile
from .admission import Admission, CutOffError, DrainingError

log = logging.getLogger("pns.service")


T = TypeVar("T")


class FileAnswer(Response):
    """Sends a memory file piece by piece, then releases it.

    A client that takes nothing of it for `stall_seconds` is cut off. One that is gone is sent
    nothing more: the pieces that are left would be read for nobody, and hold the event loop. `sent`
    is called once all of it was sent, and not where it is refused or cut off, or the client gone.
    """

    def __init__(
        self,
        content: MemoryFile,
        admission: Admission,
        client: str,
        *,
        stall_seconds: float,
        media_type: str,
        headers: dict[str, str],
        sent: Callable[[], None] = lambda: None,
    ) -> None:
        always = {"Content-Length": str(content.size), "Vary": "Accept"}
        super().__init__(media_type=media_type, headers=headers | always)
        self._content = content
        self._admission = admission
        self._client = client
        self._stall_seconds = stall_seconds
        self._sent = sent

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer."""
        with self._content:
            taking = self._admission.answering(self._client, self._content.size)
            try:
                async with self._admission.working(), taking:
                    start = {"status": self.status_code, "headers": self.raw_headers}
                    await send({"type": "http.response.start"} | start)
                    if await self._send_pieces(send, receive):
                        self._sent()
            except TimeoutError:
                log.warning("an answer is cut off: nothing for %g seconds", self._stall_seconds)
            except CutOffError:
                log.warning("an answer is cut off: its memory is needed")
            except DrainingError:
                log.warning("an answer was cut off by the shutdown")

    async def _send_pieces(self, send: Send, receive: Receive) -> bool:
        """Return whether the client was there for all of them."""
        leaves = asyncio.create_task(until_gone(receive))
        pieces, piece, left = self._content.pieces(), b".", self._content.size
        try:
            while piece:
                # To one who is gone `send` returns at once, and nobody else would have a turn.
                await asyncio.sleep(0)
                if leaves.done():
                    break
                piece = next(pieces, b"")
                async with asyncio.timeout(self._stall_seconds):
                    await send(
                        {"type": "http.response.body", "body": piece, "more_body": piece != b""}
                    )
                left -= len(piece)
        finally:
            leaves.cancel()
        # Who has all may leave before it is told that nothing follows.
        return left == 0


async def unless_gone(receive: Receive, work: Coroutine[Any, Any, T]) -> T:
    """Return the value of `work`, cancelled if the client disconnects. Raises ClientDisconnect."""
    job = asyncio.create_task(work)
    gone = asyncio.create_task(until_gone(receive))
    try:
        await asyncio.wait({job, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not job.done():
            raise ClientDisconnect
        return job.result()
    finally:
        job.cancel()
        gone.cancel()
        await asyncio.gather(job, gone, return_exceptions=True)


async def until_gone(receive: Receive) -> None:
    """Wait until the client has left; the body has been read."""
    while (await receive())["type"] != "http.disconnect":
        pass


def answer_type(request: Request, file_type: str = media.GLB) -> str:
    """Return the media type that the client wants most; `file_type` is that of the file.

    Generated clients know a file by `application/octet-stream` alone, and may ask for that.
    """
    # Several lines of it are one; without any, all are equal.
    accept = ",".join(request.headers.getlist("accept"))
    # In the order of preference among equals.
    return max((file_type, media.JSON, media.BYTES), key=lambda kind: media.quality(kind, accept))


def is_known(tag: str, request: Request) -> bool:
    """Return whether the client has the content of an ETag: its If-None-Match says so."""
    sent = request.headers.get("if-none-match", "").split(",")
    return bool({one.strip().removeprefix("W/") for one in sent} & {tag, "*"})


def server_timing(seconds: dict[str, float]) -> str:
    """Return the value of `Server-Timing`: milliseconds by stage."""
    return ", ".join(f"{stage};dur={1000 * value:.1f}" for stage, value in seconds.items())
