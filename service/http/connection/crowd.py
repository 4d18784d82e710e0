"""Who is connected: at most so many in all, and so many of one address."""

from __future__ import annotations

from collections import Counter
from math import inf
from typing import Protocol

from ..addresses import Network, is_named, site

LISTENS = "pns.listens"
"""Name of the ASGI extension by which an application says that its answer is a stream that the
client may ask for again: a function to call before it begins."""


class Guest(Protocol):
    """A connection, as the crowd sees it."""

    def is_idle(self) -> bool:
        """Whether its client has really said nothing: not even what is yet unread."""
        ...

    def rate(self) -> float:
        """Bytes a second that its client sends or takes; infinite while it is early to tell."""
        ...

    def give_way(self) -> None:
        """End at once."""
        ...


class Crowd:
    """The open connections, by address.

    Proxies are exempt from the share of an address: many clients come through one. Where all places
    are taken, one gives way to a new connection, so that neither idle nor slow clients lock anybody
    out: the oldest whose client has asked for nothing yet, else the slowest of those that the
    service waits for, and of equally slow ones the oldest of the address with the most connections.
    """

    def __init__(self, most: int, most_of_address: int, proxies: tuple[Network, ...] = ()) -> None:
        self.most = most
        self.most_of_address = most_of_address
        self.proxies = proxies
        self.refused = 0
        self._of_address: Counter[str] = Counter()
        self._count = 0
        # In the order in which they began to wait.
        self._waiting: dict[Guest, None] = {}
        # With the name of the address.
        self._slow: dict[Guest, str] = {}

    def __len__(self) -> int:
        return self._count

    def enter(self, address: str) -> str | None:
        """Take a place for a connection; where there is none, say why and take none."""
        name = site(address)
        if self._of_address[name] >= self.most_of_address and not is_named(address, self.proxies):
            self.refused += 1
            return f"{self.most_of_address} connections of your address are open"
        if self._count >= self.most and not self._make_room():
            self.refused += 1
            return f"{self.most} connections are open"
        self._of_address[name] += 1
        self._count += 1
        return None

    def leave(self, guest: Guest, address: str) -> None:
        """Give the place of a connection back."""
        self.work(guest)
        name = site(address)
        self._of_address[name] -= 1
        if not self._of_address[name]:
            del self._of_address[name]
        self._count -= 1

    def wait(self, guest: Guest) -> None:
        """Note that a connection asks for nothing."""
        self._slow.pop(guest, None)
        self._waiting.setdefault(guest)

    def attend(self, guest: Guest, address: str) -> None:
        """Note that a connection has asked, and that the service waits for its client."""
        self._waiting.pop(guest, None)
        if guest not in self._slow:
            self._slow[guest] = site(address)

    def work(self, guest: Guest) -> None:
        """Note that a connection has asked, and waits for the service."""
        self._waiting.pop(guest, None)
        self._slow.pop(guest, None)

    def _make_room(self) -> bool:
        guest = next((guest for guest in self._waiting if guest.is_idle()), None)
        guest = guest or self._slowest()
        if guest is None:
            return False
        self.work(guest)
        guest.give_way()
        return True

    def _slowest(self) -> Guest | None:
        """The slowest, where there is one whose rate can be told."""
        rates = {guest: guest.rate() for guest in self._slow}
        told = [guest for guest, rate in rates.items() if rate < inf]
        return min(
            told,
            key=lambda guest: (rates[guest], -self._of_address[self._slow[guest]]),
            default=None,
        )
