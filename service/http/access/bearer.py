"""Authorization: Bearer: the routes that cost something are for the bearers of keys."""

from __future__ import annotations

import re
from collections.abc import Iterable

from starlette.types import ASGIApp, Receive, Scope, Send

from ...errors import UnauthorizedError
from .. import problems
from ..clients import Client
from .keys import Entry, hash_of

_BEARER = re.compile(r"(?i:bearer) +([!-~]+)")
# Routes that anybody may ask: they cost nothing and say nothing of anyone. A key that is sent to
# them is checked all the same.
OPEN = ("/", "/healthz", "/readyz", "/models", "/limits", "/docs", "/openapi.json")
OPEN_FOLDERS = ("/assets/", "/docs/")


class Bearer:
    """ASGI layer that finds the client behind a key, and refuses those without one."""

    def __init__(self, app: ASGIApp, keys: Iterable[Entry]) -> None:
        self.app = app
        self._keys = {entry.hash: entry for entry in keys}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        try:
            self._admit(scope)
        except UnauthorizedError as error:
            await problems.of_service_error(error)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _admit(self, scope: Scope) -> None:
        sent = [value for name, value in scope["headers"] if name == b"authorization"]
        if not sent:
            path = scope["path"].removeprefix(scope.get("root_path", ""))
            if path in OPEN or path.startswith(OPEN_FOLDERS):
                return
            raise UnauthorizedError("send a key: Authorization: Bearer pns_…")
        token = _BEARER.fullmatch(sent[0].decode("latin-1").strip()) if len(sent) == 1 else None
        if token is None:
            raise UnauthorizedError("the Authorization header holds no key: Bearer pns_…")
        # How long this takes tells of the hash alone, and nobody finds a key by its hash.
        entry = self._keys.get(hash_of(token[1]))
        if entry is None:
            raise UnauthorizedError("the key is not known")
        client = Client(f"key:{entry.name}", entry.faces_per_minute, named=True)
        scope.setdefault("state", {})["client"] = client
