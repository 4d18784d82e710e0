"""Authorization: Bearer: the routes that cost something are for the bearers of keys."""

from __future__ import annotations

import asyncio
import hashlib
import logging
import re
import time
from collections import Counter
from collections.abc import Iterable

from starlette.types import ASGIApp, Receive, Scope, Send

from ...errors import BusyError, ServiceError, UnauthorizedError
from .. import problems
from ..clients import Client, sites
from .keys import NAME, PREFIX, Entry, Keyring

log = logging.getLogger("pns.service")

_BEARER = re.compile(rf"(?i:bearer) +({PREFIX}_({NAME})_[\w-]{{43}})", re.A)
# Routes that anybody may ask: they cost nothing and say nothing of anyone. A key that is sent to
# them is checked all the same.
OPEN = ("/", "/healthz", "/readyz", "/models", "/limits", "/docs", "/openapi.json")
OPEN_FOLDERS = ("/assets/", "/docs/")
# Each wrong key costs a scrypt. An address has so many a minute for each name that it sends; in
# IPv6 a /56 and a /48 have more, as they hold more subscribers.
WRONG_A_MINUTE = 20
WIDER = (1, 4, 16)
# Checks that may wait: in all, of one address, and how many places are kept for addresses that have
# sent no wrong key.
MOST_WAITING = 8
MOST_OF_ADDRESS = 4
KEPT_FREE = 2
MINUTE = 60.0
PAUSE_SECONDS = 1.0


class TooManyWrongKeysError(BusyError):
    """An address has sent one wrong key of a name after another."""

    status = 429
    code = "too-many-wrong-keys"
    title = "Too many wrong keys"


class Bearer:
    """ASGI layer that finds the client behind a key, and refuses those without one."""

    def __init__(self, app: ASGIApp, keys: Iterable[Entry]) -> None:
        self.app = app
        self._keys = Keyring(keys)
        # Of keys that were right, by their plain hash: scrypt is run once for each.
        self._known: dict[bytes, Entry] = {}
        # Of keys that are being checked, whoever waits for that.
        self._checks: dict[bytes, asyncio.Task[Entry]] = {}
        self._one = asyncio.Semaphore(1)
        self._waiting: Counter[str] = Counter()
        # By network and by the name in the key.
        self._wrong: Counter[tuple[str, str]] = Counter()
        self._wrong_since = time.monotonic()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        try:
            await self._admit(scope)
        except ServiceError as error:
            await problems.of_service_error(error)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    async def _admit(self, scope: Scope) -> None:
        sent = [value for name, value in scope["headers"] if name == b"authorization"]
        if not sent:
            path = scope["path"].removeprefix(scope.get("root_path", ""))
            if path in OPEN or path.startswith(OPEN_FOLDERS):
                return
            raise UnauthorizedError("send a key: Authorization: Bearer pns_…")
        token = _BEARER.fullmatch(sent[0].decode("latin-1").strip()) if len(sent) == 1 else None
        if token is None:
            raise UnauthorizedError("the Authorization header holds no key: Bearer pns_…")
        entry = await self._entry(token[1], token[2], scope)
        client = Client(f"key:{entry.name}", entry.faces_per_minute, named=True)
        scope.setdefault("state", {})["client"] = client

    async def _entry(self, key: str, name: str, scope: Scope) -> Entry:
        plain = hashlib.sha256(key.encode()).digest()
        if plain in self._known:
            return self._known[plain]
        check = self._checks.get(plain)
        if check is None:
            networks = sites(scope["client"][0] if scope.get("client") else "")
            self._check_patience(networks, name)
            self._waiting[networks[0]] += 1
            check = self._checks[plain] = asyncio.create_task(self._checked(key, name, networks))

            def end(ended: asyncio.Task[Entry]) -> None:
                del self._checks[plain]
                self._waiting -= Counter({networks[0]: 1})
                if not ended.cancelled() and ended.exception() is None:
                    self._known[plain] = ended.result()

            check.add_done_callback(end)
        # Who leaves ends it for nobody else.
        return await asyncio.shield(check)

    async def _checked(self, key: str, name: str, networks: tuple[str, ...]) -> Entry:
        async with self._one:
            entry = await asyncio.to_thread(self._keys.find, key, name)
        if entry is None:
            self._wrong.update((network, name) for network in networks)
            if self._wrong_of(networks[0]) > WRONG_A_MINUTE:
                # Names without end are guessed slowly.
                await asyncio.sleep(PAUSE_SECONDS)
            raise UnauthorizedError("the key is not known")
        return entry

    def _check_patience(self, networks: tuple[str, ...], name: str) -> None:
        now = time.monotonic()
        if now - self._wrong_since > MINUTE:
            self._wrong.clear()
            self._wrong_since = now
        for network, times in zip(networks, WIDER, strict=False):
            if self._wrong[network, name] >= WRONG_A_MINUTE * times:
                raise TooManyWrongKeysError(
                    f"too many wrong keys of the name {name}: wait a minute",
                    retry_after=int(MINUTE),
                )
        places = MOST_WAITING - (KEPT_FREE if self._wrong_of(networks[0]) else 0)
        if self._waiting.total() >= places or self._waiting[networks[0]] >= MOST_OF_ADDRESS:
            raise BusyError("too many keys are being checked")

    def _wrong_of(self, network: str) -> int:
        return sum(count for (where, _), count in self._wrong.items() if where == network)
