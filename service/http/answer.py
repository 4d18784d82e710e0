"""The answer to a request whose bytes a worker left in a memory file."""

from __future__ import annotations

import asyncio
import logging
from contextlib import ExitStack

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from ..workers.memory_file import MemoryFile
from .admission import Admission, CutOffError, DrainingError
from .head import HEAD_ALONE

log = logging.getLogger("pns.service")


class FileAnswer(Response):
    """Sends a memory file piece by piece, then lets go of what the request held.

    A client that takes longer than `stall_seconds` for one piece is cut off: its answer is memory.
    """

    def __init__(
        self,
        content: MemoryFile,
        held: ExitStack,
        admission: Admission,
        *,
        media_type: str,
        headers: dict[str, str],
        stall_seconds: float,
    ) -> None:
        super().__init__(
            media_type=media_type, headers=headers | {"Content-Length": str(content.size)}
        )
        self._content = content
        self._held = held
        self._admission = admission
        self._stall_seconds = stall_seconds

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer."""
        with self._held:
            try:
                async with self._admission.working(), self._admission.answering(self._content.size):
                    await self._send_start(send)
                    # What nobody gets is not read: it would hold the event loop.
                    if HEAD_ALONE not in scope.get("extensions", {}):
                        await self._send_pieces(send)
            except (TimeoutError, CutOffError):
                log.warning("a client took too long to read its answer")
            except DrainingError:
                log.warning("an answer was cut off by the shutdown")

    async def _send_start(self, send: Send) -> None:
        await send(
            {
                "type": "http.response.start",
                "status": self.status_code,
                "headers": self.raw_headers,
            }
        )

    async def _send_pieces(self, send: Send) -> None:
        for piece in self._content.pieces():
            message = {"type": "http.response.body", "body": piece, "more_body": True}
            async with asyncio.timeout(self._stall_seconds):
                await send(message)
        await send({"type": "http.response.body", "body": b""})
