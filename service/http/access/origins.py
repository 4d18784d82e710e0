"""Origins: which pages may have a visitor's browser ask for work.

A browser sends a form to any host that a page names, without asking first; only the answer is kept
from the page. So any page could use up its visitors' budgets, or their own machines, where the
service listens for them alone. A page whose own name is made to lead to this machine (DNS
rebinding) has the same origin and host: so Starlette's TrustedHost checks the name, too.
"""

from __future__ import annotations

from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Receive, Scope, Send

from ...errors import ServiceError
from ...settings import Settings
from .. import problems

# What these ask for costs little, and no page of another origin is shown the answer.
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
# What a browser says of who asks: a page of this origin, or nobody but the user.
OWN = frozenset({"same-origin", "none"})
LOOPBACK_HOSTS = ("localhost", "*.localhost", "127.0.0.1", "[::1]")


class ForeignOriginError(ServiceError):
    """A page of an origin that is not named asks for work."""

    status = 403
    code = "foreign-origin"
    title = "A page of another origin may not ask"


def hosts_of(settings: Settings) -> tuple[str, ...]:
    """Return the patterns of host names that are served; those of loopback where only it is bound.

    Elsewhere any name is, unless they are listed: nobody knows what a network calls this machine.
    """
    if settings.hosts:
        return settings.hosts
    alone = is_loopback(settings.host) and not settings.proxies
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    return (*LOOPBACK_HOSTS, host) if alone else ("*",)


def is_loopback(host: str) -> bool:
    """Return whether a host to listen on is reached from this machine alone."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Origins:
    """ASGI layer that refuses work that foreign pages ask for.

    Clients that are no browsers send no origin, and are not asked for one.
    """

    def __init__(self, app: ASGIApp, named: tuple[str, ...]) -> None:
        self.app = app
        self.named = frozenset(named)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        sent = {name: value.decode("latin-1") for name, value in scope["headers"]}
        try:
            self._check(scope["method"], sent)
        except ServiceError as error:
            await problems.of_service_error(error)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _check(self, method: str, sent: dict[bytes, str]) -> None:
        host = _host(f"//{sent.get(b'host', '')}")
        if method not in SAFE and not self._may_ask(sent, host):
            raise ForeignOriginError(
                "a page of another origin asks; PNS_CORS_ORIGINS names those that may"
            )

    def _may_ask(self, sent: dict[bytes, str], host: str) -> bool:
        origin, site = sent.get(b"origin"), sent.get(b"sec-fetch-site")
        if "*" in self.named or origin in self.named:
            return True
        if site is not None:
            return site in OWN
        # To hosts without TLS browsers say the origin alone. Not its port: proxies leave it out.
        return origin is None or _host(origin) == host != ""


def _host(address: str) -> str:
    """Return the host of an address; empty where it has none."""
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""
