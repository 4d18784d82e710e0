"""The outermost layer: a body over its limit is refused before anything parses or keeps it."""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import LimitError, ServiceError, UnreadableError, check_limit
from . import problems
from .connection.pace import Pace
from .connection.parser import BYTES_A_PIECE, FLOODED, FREE_PIECES


class UploadTimeoutError(ServiceError):
    """The body took longer to arrive than an upload may."""

    status = 408
    code = "upload-timeout"
    title = "The upload took too long"


class BodyLimit:
    """ASGI layer that counts a request's body while it arrives, in bytes, pieces and seconds.

    A Content-Length over the limit is answered at once with 413. A body without one is counted: the
    read that passes the limit raises LimitError inside the application, as does one of a body in
    countless pieces; a read for which the client took longer than its pace allows raises
    UploadTimeoutError. Only waiting for the client is counted, not what is done in between. What
    nobody reads is the connection's to bound.
    """

    def __init__(self, app: ASGIApp, *, max_bytes: int, pace: Pace) -> None:
        self.app = app
        self.max_bytes = max_bytes
        self.pace = pace

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        try:
            self._check_announced(scope)
        except ServiceError as error:
            await problems.of_service_error(error)(scope, receive, send)
            return
        await self.app(scope, self._counted(scope, receive), send)

    def _check_announced(self, scope: Scope) -> None:
        for name, value in scope["headers"]:
            if name == b"content-length":
                if not value.isdigit():
                    raise UnreadableError("Content-Length is not a number")
                self._check(int(value))

    def _check(self, size: int) -> None:
        check_limit("body", size, self.max_bytes, f"the body has {size} bytes or more")

    def _counted(self, scope: Scope, receive: Receive) -> Receive:
        size = 0
        waited = 0.0
        complete = False
        clock = asyncio.get_running_loop().time
        is_flood = scope.get("extensions", {}).get(FLOODED, bool)

        async def counted() -> Message:
            nonlocal size, waited, complete
            if complete:
                # Only a disconnect can follow, and that may be waited for without a limit.
                return await receive()
            began = clock()
            try:
                async with asyncio.timeout(self.pace.patience(size, waited)):
                    message = await receive()
            except TimeoutError as error:
                excuse = self.pace.excuse(size, waited + clock() - began)
                raise UploadTimeoutError(f"the body: {excuse}") from error
            waited += clock() - began
            if message["type"] == "http.request":
                size += len(message.get("body", b""))
                complete = not message.get("more_body", False)
                self._check(size)
                if is_flood():
                    raise _flood()
            return message

        return counted


def _flood() -> LimitError:
    return LimitError(
        f"the body comes in more pieces than {FREE_PIECES}, each of fewer than {BYTES_A_PIECE} "
        "bytes; send larger chunks",
        limit="pieces",
        allowed=FREE_PIECES,
        found=FREE_PIECES + 1,
    )
