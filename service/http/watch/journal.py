"""The journal: for each request an id, one line and its counts."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...errors import BusyError
from ...log_lines import HEADER, REQUEST_ID, id_of
from .. import problems
from ..access.clients import Client
from .tracing import mark_span

log = logging.getLogger("pns.request")

# Anything may be sent as a method; what is none of these is counted as one.
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
# Answers hold what strangers have sent: browsers are not to guess what it is.
NO_SNIFFING = (b"x-content-type-options", b"nosniff")
# Where a client is gone before it has its answer, as proxies log it.
GONE = 499


@dataclass(frozen=True, slots=True)
class Entry:
    """A request that has ended.

    Attributes:
        route: its pattern (`/assets/{name}`), never what was in it; `none` where none matched.
        code: the problem's code, or empty.
        received, sent: bytes of the bodies.
    """

    id: str
    method: str
    route: str
    status: int
    code: str
    client: str
    received: int
    sent: int
    seconds: float


class Journal:
    """ASGI layer that names requests, writes down how each ended, and tells `count`.

    Neither query strings nor paths are written: they may hold what a client would not like to see
    in a log (a file's name).
    """

    def __init__(self, app: ASGIApp, count: Callable[[Entry], None]) -> None:
        self.app = app
        self.count = count

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        clock, method = time.perf_counter(), scope["method"]
        if method == "HEAD":
            # Of the answer uvicorn sends the head alone.
            scope = {**scope, "method": "GET"}
        name = id_of(scope["headers"])
        token = REQUEST_ID.set(name)
        mark_span(name)
        state = scope.setdefault("state", {})
        state["request_id"] = name
        status, received, sent, whole = 0, 0, 0, False

        async def counted_receive() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            return message

        async def counted_send(message: Message) -> None:
            nonlocal status, sent, whole
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = [*message.get("headers", []), (HEADER, name.encode()), NO_SNIFFING]
                message = {**message, "headers": headers}
            else:
                sent += len(message.get("body", b""))
                whole = not message.get("more_body", False)
            await send(message)

        try:
            await self.app(scope, counted_receive, counted_send)
        except asyncio.CancelledError:
            # Uvicorn's way to say that the time after SIGTERM is over; it cuts off what has begun.
            if not status:
                over = BusyError("the service shuts down", retry_after=5)
                await problems.of_service_error(over)(scope, receive, counted_send)
        except BaseException:
            status = status or 500
            raise
        finally:
            self._write(
                Entry(
                    id=name,
                    method=method if method in METHODS else "other",
                    route=_route(scope),
                    status=status if whole or status >= 400 else GONE,
                    code=state.get("problem", ""),
                    client=_client(scope),
                    received=received,
                    sent=sent,
                    seconds=time.perf_counter() - clock,
                )
            )
            REQUEST_ID.reset(token)

    def _write(self, entry: Entry) -> None:
        fields = asdict(entry)
        name = fields.pop("id")
        fields["milliseconds"] = round(1000 * fields.pop("seconds"), 1)
        log.info("request", extra={"fields": fields, "request_id": name})
        self.count(entry)


def _route(scope: Scope) -> str:
    """Return the pattern of the route that was asked, also where a layer refused the request."""
    route = scope.get("route")
    if route is None and "app" in scope:
        routes = getattr(scope["app"].state, "routes", ())
        route = next((one for one in routes if one.matches(scope)[0] is not Match.NONE), None)
    return getattr(route, "path", None) or "none"


def _client(scope: Scope) -> str:
    known = scope["state"].get("client")
    if isinstance(known, Client):
        return known.id
    return scope["client"][0] if scope.get("client") else ""
