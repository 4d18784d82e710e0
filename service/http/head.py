"""HEAD, wherever there is GET."""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Head:
    """ASGI layer that asks the routes for a GET and sends its head alone.

    An answer that never ends (a stream of events) ends here: the application sees a client that
    has left.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return
        ended = False

        async def head_only(message: Message) -> None:
            nonlocal ended
            if ended:
                return
            await send(message)
            if message["type"] == "http.response.start":
                ended = True
                await send({"type": "http.response.body", "body": b"", "more_body": False})

        async def gone() -> Message:
            return {"type": "http.disconnect"} if ended else await receive()

        # The scope stays one: what a route writes into it is for the layers outside, too.
        scope["method"] = "GET"
        try:
            await self.app(scope, gone, head_only)
        finally:
            scope["method"] = "HEAD"
