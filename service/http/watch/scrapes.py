"""/metrics as an application: one text a second, however often it is asked for."""

from __future__ import annotations

import time
from collections.abc import Callable

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

FRESH_SECONDS = 1.0


def scrapes(registry: CollectorRegistry, clock: Callable[[], float] = time.monotonic) -> ASGIApp:
    """Return an application that answers GET /metrics with the state of a registry."""
    text, made = b"", float("-inf")

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        nonlocal text, made
        if scope["path"] != "/metrics" or scope["method"] not in ("GET", "HEAD"):
            answer: Response = PlainTextResponse("GET /metrics", 404)
        else:
            # Nothing is awaited: of many scrapes at once the first makes the text.
            if clock() - made >= FRESH_SECONDS:
                text, made = generate_latest(registry), clock()
            answer = Response(text, media_type=CONTENT_TYPE_LATEST)
        await answer(scope, receive, send)

    return app
