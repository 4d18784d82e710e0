"""Clients: who asks, how many requests each may have here, and how many faces a minute."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address, ip_network

from fastapi import Request

from ...errors import BusyError
from ...settings import Settings

# One subscriber of IPv6 is given a /64 at least.
IPV6_NETWORK = 64
MINUTE = 60.0
# Clients beyond which those who have paid back are forgotten.
MANY = 10_000


class OverBudgetError(BusyError):
    """The client has made more faces than it may in a minute."""

    status = 429
    code = "over-budget"
    title = "The client's budget of faces is used up"


class TooManyRequestsError(BusyError):
    """The client has as many requests here as one client may."""

    status = 429
    code = "too-many-requests"
    title = "The client has too many requests under way"


@dataclass(frozen=True, slots=True)
class Client:
    """A client.

    Attributes:
        id: the same for all its requests; `key:NAME` or `address:…`.
        faces_per_minute: its budget of refined faces; None: no limit.
    """

    id: str
    faces_per_minute: float | None


def client_of(request: Request, settings: Settings) -> Client:
    """Return the client of the key that was sent, else of the address that asks."""
    identified = getattr(request.state, "client", None)
    if isinstance(identified, Client):
        return identified
    host = "" if request.client is None else request.client.host
    return Client(f"address:{site(host)}", settings.faces_per_minute)


def site(address: str) -> str:
    """Return the address or, in IPv6, the network of its subscriber."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    if not isinstance(parsed, IPv6Address):
        return address
    if parsed.ipv4_mapped:
        return str(parsed.ipv4_mapped)
    return str(ip_network((int(parsed), IPV6_NETWORK), strict=False))


class Places:
    """Places for requests, from their head to the end of their answer.

    Bodies and answers are memory, and so bounded: all together take `places`, one client `own`.
    Where none is free for a client, the one who holds more than it loses the oldest answer that it
    is taking: so slow readers keep nobody out.
    """

    def __init__(self, places: int, own: int) -> None:
        # The oldest first.
        self._taking: dict[asyncio.Timeout, str] = {}
        self._places = places
        self._own = min(own, places)
        self.taken: Counter[str] = Counter()
        """Number of requests by client; a client without one is not there."""

    @contextmanager
    def held(self, client: str) -> Iterator[None]:
        """Hold a place. Raises TooManyRequestsError, or BusyError where none is free."""
        mine, all_taken = self.taken[client], self.taken.total()
        if mine >= self._own:
            text = f"{mine} requests of this client are under way, as many as one client may have"
            raise TooManyRequestsError(text, retry_after=mine)
        if all_taken >= self._places and not self._give_way(mine):
            raise BusyError(f"{all_taken} requests are under way; no more fit", retry_after=5)
        self.taken[client] += 1
        try:
            yield
        finally:
            self.taken -= Counter([client])

    @contextmanager
    def taking(self, client: str, end: asyncio.Timeout) -> Iterator[None]:
        """Be an answer on its way, which `end` may be told to end."""
        self._taking[end] = client
        try:
            yield
        finally:
            self._taking.pop(end, None)

    def _give_way(self, mine: int) -> bool:
        """End an answer of the client who holds the most; False where nobody holds more."""
        held = {end: self.taken[client] for end, client in self._taking.items()}
        end = max(held, key=lambda end: held[end], default=None)
        if end is None or held[end] <= mine + 1:
            return False
        del self._taking[end]
        end.reschedule(asyncio.get_running_loop().time())
        return True


class FacesBudget:
    """Token buckets: each refills evenly and holds a minute's worth.

    A job is charged what it made, and may leave a debt. `now` is a clock in seconds.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        # For each client what it has used, when that was last counted, and its faces a minute.
        self._used: dict[str, tuple[float, float, float]] = {}

    def check(self, client: Client) -> None:
        """Raise OverBudgetError where nothing is left; `retry_after` says when there will be."""
        per_minute = client.faces_per_minute
        used = self._used_by(client.id)
        if per_minute is not None and used >= per_minute:
            raise OverBudgetError(
                f"{used:.0f} faces were made, {per_minute:.0f} a minute are allowed",
                retry_after=int((used - per_minute) / per_minute * MINUTE) + 1,
            )

    def charge(self, client: Client, faces: int) -> None:
        """Take faces that were made from a client's budget."""
        if client.faces_per_minute is None:
            return
        if len(self._used) > MANY:
            self._used = {name: own for name, own in self._used.items() if self._used_by(name)}
        used = self._used_by(client.id) + faces
        self._used[client.id] = (used, self._now(), client.faces_per_minute)

    def _used_by(self, client: str) -> float:
        used, then, per_minute = self._used.get(client, (0.0, 0.0, 0.0))
        return max(used - (self._now() - then) * per_minute / MINUTE, 0.0)
