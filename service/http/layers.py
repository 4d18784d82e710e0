"""The layers around the routes, from the outside in."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import BusyError
from ..settings import Settings
from . import problems
from .access.bearer import Bearer
from .access.keys import Entry
from .access.origins import Origins, hosts_of
from .admission import Admission
from .body_limits import BodyLimit, Pace
from .watch.journal import Journal
from .watch.metrics import Metrics
from .watch.tracing import record

if TYPE_CHECKING:
    from opentelemetry.trace import Tracer

# What a page of another origin may send, beside what any may: all that is read here.
TAKEN = (
    *("Authorization", "Content-Encoding", "Content-Type", "If-None-Match"),
    *("Traceparent", "Tracestate", "X-Request-ID"),
)
# What it may read of an answer beside its body.
EXPOSED = ("ETag", "Location", "Retry-After", "Server-Timing", "X-Request-ID")

CLOSE = (b"connection", b"close")
PROBES = frozenset({"/healthz", "/readyz"})


def around(
    routes: ASGIApp,
    settings: Settings,
    most: int,
    admission: Admission,
    metrics: Metrics,
    keys: list[Entry] | None,
    tracer: Tracer | None = None,
) -> ASGIApp:
    """Lay around the routes everything that is done for every request.

    `most` requests may be under way. `keys` None: it is open to everybody; `tracer` None: nothing
    is traced.
    """
    app: ASGIApp = Head(routes)
    app = BodyLimit(app, max_bytes=int(settings.body), pace=upload_pace(settings))
    if keys is not None:
        app = Bearer(app, keys)
    app = Origins(app, settings.cors_origins, hosts_of(settings))
    if settings.cors_origins:
        app = CORSMiddleware(
            app,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=TAKEN,
            expose_headers=EXPOSED,
        )
    spans = [] if tracer is None else [partial(record, tracer)]
    app = Journal(Crowd(app, most), metrics.request, *spans)
    app = Endings(app, lambda: admission.leaving or admission.crowded)

    async def requests(scope: Scope, receive: Receive, send: Send) -> None:
        await (app if scope["type"] == "http" else routes)(scope, receive, send)

    return requests


def upload_pace(settings: Settings) -> Pace:
    """Return how fast a body must come."""
    return Pace(
        rate=int(settings.rate),
        grace=settings.grace_seconds,
        idle=settings.idle_seconds,
        whole=settings.upload_seconds,
    )


class Endings:
    """ASGI layer that ends no connection on a client that still sends its body.

    What it sends after that would be met by a reset, and the answer lost: a proxy makes a 502 of
    it. So once `last` says so, an answer is the last on its connection where the body is whole;
    and where the client wants the connection closed, the answer ends when the body does, or when
    the server ends the connection.
    """

    def __init__(self, app: ASGIApp, last: Callable[[], bool]) -> None:
        self.app = app
        self._last = last

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        sends, held = _has_body(scope), False
        # The end of an answer to HEAD is what ends its route.
        closes = scope["method"] != "HEAD" and _wants_to_close(scope)

        async def noted() -> Message:
            nonlocal sends
            message = await receive()
            sends = sends and message.get("more_body", False)
            return message

        async def ending(message: Message) -> None:
            nonlocal held
            if message["type"] == "http.response.start":
                if self._last() and not sends:
                    message = {**message, "headers": [*message.get("headers", []), CLOSE]}
            elif sends and closes and not message.get("more_body"):
                held = True
                message = {**message, "more_body": True}
            await send(message)

        await self.app(scope, noted, ending)
        if held:
            scope["state"]["answered"] = True
            while sends:
                await noted()
            await send({"type": "http.response.body", "body": b""})


def _has_body(scope: Scope) -> bool:
    headers = dict(scope["headers"])
    length = headers.get(b"content-length", b"0")
    return b"transfer-encoding" in headers or length.strip(b"0") != b""


def _wants_to_close(scope: Scope) -> bool:
    said = (value.lower() for name, value in scope["headers"] if name == b"connection")
    return scope["http_version"] == "1.0" or any(b"close" in value for value in said)


class Crowd:
    """ASGI layer that begins requests one after the other, of which `most` may be under way.

    Hundreds that come at the same moment would hold the event loop together. Probes pass them.
    """

    def __init__(self, app: ASGIApp, most: int) -> None:
        self.app = app
        self._most = most
        self._under_way = 0
        self._turn = asyncio.Lock()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["path"] in PROBES:
            await self.app(scope, receive, send)
            return
        if self._under_way >= self._most:
            error = BusyError("too many requests are under way")
            await problems.of_service_error(error)(scope, receive, send)
            return
        self._under_way += 1
        try:
            async with self._turn:
                await asyncio.sleep(0)
            await self.app(scope, receive, send)
        finally:
            self._under_way -= 1


class Head:
    """ASGI layer that asks the routes for a GET and sends its head alone.

    An answer that never ends (a stream of events) ends here: the application sees a client that
    has left.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["method"] != "HEAD":
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
