"""Origins and hosts: which pages may have a visitor's browser ask for work.

A browser sends a form to any host that a page names, without asking first; only the answer is kept
from the page. So any page could use up its visitors' budgets, or their own machines, where the
service listens for them alone. A page whose own name is made to lead to this machine (DNS
rebinding) has the same origin and host: so names are checked, too. An address and `localhost` are
nobody's to lead elsewhere. Starlette's TrustedHost knows no addresses, which probes ask.
"""

from __future__ import annotations

from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.types import Scope

from ...errors import ServiceError
from ...settings import Settings

# What these ask for costs little, and no page of another origin is shown the answer.
SAFE = frozenset({"GET", "OPTIONS"})
# What a browser says of who asks: a page of this origin, or nobody but the user.
OWN = frozenset({"same-origin", "none"})


class ForeignOriginError(ServiceError):
    """A page of an origin that is not named asks for work."""

    status = 403
    code = "foreign-origin"
    title = "A page of another origin may not ask"


class UnknownHostError(ServiceError):
    """The request names a host that the service is not called."""

    status = 400
    code = "unknown-host"
    title = "The service is not called by this name"


def is_loopback(host: str) -> bool:
    """Return whether a host to listen on is reached from this machine alone."""
    return ip_address(host).is_loopback if _is_address(host) else host == "localhost"


def _is_address(host: str) -> bool:
    try:
        return bool(ip_address(host))
    except ValueError:
        return False


class Origins:
    """Refuses foreign names, and work that foreign pages ask for.

    Clients that are no browsers send no origin, and are not asked for one.
    """

    def __init__(self, settings: Settings) -> None:
        self.named = frozenset(settings.cors_origins)
        self.hosts = ("localhost", "*.localhost", settings.host.lower(), *settings.hosts)

    def check(self, scope: Scope) -> None:
        """Check the head of a request. Raises UnknownHostError, ForeignOriginError."""
        sent = {name: value.decode("latin-1") for name, value in scope["headers"]}
        host = _host(f"//{sent.get(b'host', '')}")
        # HTTP/1.0 may leave it out; browsers do not.
        if b"host" in sent and not self._is_own(host):
            raise UnknownHostError(
                "the Host is no address, not localhost, and none of the names in PNS_HOSTS"
            )
        if scope["method"] not in SAFE and not self._may_ask(sent, host):
            raise ForeignOriginError(
                "a page of another origin asks; PNS_CORS_ORIGINS names those that may"
            )

    def _is_own(self, host: str) -> bool:
        return _is_address(host) or any(
            host == name or (name[0] == "*" and host.endswith(name[1:])) for name in self.hosts
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
