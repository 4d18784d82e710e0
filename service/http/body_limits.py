"""A body over its limit is refused before anything parses or keeps it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import ServiceError, UnreadableError, check_limit
from . import problems


class UploadTimeoutError(ServiceError):
    """The body took longer to arrive than an upload may."""

    status = 408
    code = "upload-timeout"
    title = "The upload took too long"


class BodyLimit:
    """ASGI layer that counts a request's body while it arrives, in bytes and seconds.

    A Content-Length over the limit is answered at once with 413. A body without one is counted: the
    read that passes the limit raises LimitError inside the application; a read for which the client
    took longer than its pace allows raises UploadTimeoutError. Only waiting for the client is
    counted, not what is done in between, and nothing once the answer has begun.
    """

    def __init__(self, app: ASGIApp, *, max_bytes: int, pace: Pace) -> None:
        self.app = app
        self.max_bytes = max_bytes
        self.pace = pace

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        try:
            self._check_announced(scope)
        except ServiceError as error:
            await problems.of_service_error(error)(scope, receive, send)
            return
        begun = False

        async def noted(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        await self.app(scope, self._counted(receive, lambda: begun), noted)

    def _check_announced(self, scope: Scope) -> None:
        for name, value in scope["headers"]:
            if name == b"content-length":
                if not value.isdigit():
                    raise UnreadableError("Content-Length is not a number")
                self._check(int(value))

    def _check(self, size: int) -> None:
        check_limit("body", size, self.max_bytes, f"the body has {size} bytes or more")

    def _counted(self, receive: Receive, begun: Callable[[], bool]) -> Receive:
        size = 0
        waited = 0.0
        complete = False
        clock = asyncio.get_running_loop().time

        async def counted() -> Message:
            nonlocal size, waited, complete
            if complete or begun():
                # Only a disconnect is waited for, and that may take as long as it likes.
                return await receive()
            began = clock()
            try:
                async with asyncio.timeout(self.pace.patience(size, waited)):
                    message = await receive()
            except TimeoutError as error:
                if begun():
                    return await receive()
                excuse = self.pace.excuse(size, waited + clock() - began)
                raise UploadTimeoutError(f"the body: {excuse}") from error
            waited += clock() - began
            if message["type"] == "http.request":
                size += len(message.get("body", b""))
                complete = not message.get("more_body", False)
                self._check(size)
            return message

        return counted


@dataclass(frozen=True)
class Pace:
    """A least rate with three bounds on waiting; times in seconds, the rate in bytes a second.

    `rate` need not be kept from the first byte on: `grace` is how far a client may fall behind.
    """

    rate: float
    grace: float
    idle: float
    whole: float

    def patience(self, moved: int, waited: float) -> float:
        """Return how many more seconds to wait for the next byte.

        `moved` bytes have been moved so far, and the client was waited for `waited` seconds in all.
        Never more than `idle`; zero or less once the client is late.
        """
        return min(self.idle, self.grace + moved / self.rate - waited, self.whole - waited)

    def excuse(self, moved: int, waited: float) -> str:
        """Return what the client that ran out of patience has done."""
        if waited >= self.whole:
            return f"not whole within {self.whole:g} seconds"
        if waited >= self.grace + moved / self.rate:
            return f"slower than {self.rate:g} bytes a second"
        return f"nothing for {self.idle:g} seconds"
