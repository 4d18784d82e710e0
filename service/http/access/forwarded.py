"""The address and scheme that a named proxy forwards; anybody else's word is not taken."""

from __future__ import annotations

import re
from ipaddress import ip_address

from starlette.types import ASGIApp, Receive, Scope, Send

from ..addresses import Network, is_named

# Of more hops than this the rest is not looked at: each is an address to parse.
MOST_HOPS = 32
# Some proxies say the client's port too, and IPv6 then in brackets.
_WITH_PORT = re.compile(r"\[(.+)\](?::\d+)?|([\d.]+):\d+", re.A)


class Forwarded:
    """ASGI layer that puts the client's own address into the scope.

    It is the last one of `X-Forwarded-For` that is not itself a named proxy's: what stands before
    was sent by the client and may say anything. What is no address is not taken over.
    """

    def __init__(self, app: ASGIApp, proxies: tuple[Network, ...]) -> None:
        self.app = app
        self.proxies = proxies

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        client = scope.get("client")
        if scope["type"] == "http" and client and is_named(client[0], self.proxies):
            address = self._address(_values(scope, b"x-forwarded-for"))
            if address is not None:
                scope["client"] = (address, 0)
            scheme = _values(scope, b"x-forwarded-proto")
            if scheme and scheme[-1] in ("http", "https"):
                scope["scheme"] = scheme[-1]
        await self.app(scope, receive, send)

    def _address(self, hops: list[str]) -> str | None:
        for hop in reversed(hops[-MOST_HOPS:]):
            try:
                address = _address_of(hop)
            except ValueError:
                return None
            if not is_named(address, self.proxies):
                return address
        return None


def _address_of(hop: str) -> str:
    """Return the address that a hop says. Raises ValueError."""
    parts = _WITH_PORT.fullmatch(hop)
    return str(ip_address(hop if parts is None else parts[1] or parts[2]))


def _values(scope: Scope, wanted: bytes) -> list[str]:
    """Return the header's values, those of several lines in their order."""
    text = ",".join(value.decode("latin-1") for name, value in scope["headers"] if name == wanted)
    return [value.strip() for value in text.split(",") if value.strip()]
