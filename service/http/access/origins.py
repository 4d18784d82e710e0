"""Pages of other origins: which of them may have a visitor's browser ask for work.

A browser sends a form to any host that a page names, without asking first; only the answer is kept
from the page. So any page could use up its visitors' budgets, or their own machines, where the
service listens for them alone.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.types import ASGIApp, Receive, Scope, Send

from ...errors import ServiceError
from .. import problems

# What these ask for costs little, and no page of another origin is shown the answer.
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
# What a browser says of who asks: a page of this origin, or nobody but the user.
OWN = frozenset({"same-origin", "none"})


class ForeignOriginError(ServiceError):
    """A page of an origin that is not named asks for work."""

    status = 403
    code = "foreign-origin"
    title = "A page of another origin may not ask"


class Origins:
    """ASGI layer that refuses what pages of other origins ask for, but those that are named.

    Who is no browser says nothing of an origin, and is not asked.
    """

    def __init__(self, app: ASGIApp, named: tuple[str, ...]) -> None:
        self.app = app
        self.named = frozenset(named)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] == "http" and scope["method"] not in SAFE:
            sent = {name: value.decode("latin-1") for name, value in scope["headers"]}
            if not self._may_ask(sent):
                error = ForeignOriginError(
                    "a page of another origin asks; PNS_CORS_ORIGINS names those that may"
                )
                await problems.of_service_error(error)(scope, receive, send)
                return
        await self.app(scope, receive, send)

    def _may_ask(self, sent: dict[bytes, str]) -> bool:
        origin, site = sent.get(b"origin"), sent.get(b"sec-fetch-site")
        if "*" in self.named or origin in self.named:
            return True
        if site is not None:
            return site in OWN
        # To hosts without TLS browsers say the origin alone. Not its port: proxies leave it out.
        if origin is None:
            return True
        return _host(origin) == _host(f"//{sent.get(b'host', '')}") != ""


def _host(address: str) -> str:
    """Return the host of an address; empty where it has none."""
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""
