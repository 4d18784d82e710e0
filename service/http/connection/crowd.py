"""Who is connected: at most so many in all, and so many of one address."""

from __future__ import annotations

from collections import Counter
from math import inf
from typing import Protocol

from ..addresses import Network, is_named, site


class Guest(Protocol):
    """A connection, as the crowd sees it."""

    def is_idle(self) -> bool:
        """Whether its client has really said nothing: not even what is yet unread."""
        ...

    def upload_rate(self) -> float:
        """Bytes a second of the body that it sends; infinite while that is too early to tell."""
        ...

    def give_way(self) -> None:
        """End at once."""
        ...


class Crowd:
    """The open connections, by address.

    Proxies are exempt from the share of an address: many clients come through one. Where all places
    are taken, one gives way to a new connection, so that neither idle nor trickling clients lock
    anybody out: the oldest whose client has asked for nothing yet, else the slowest upload.
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
        self._sending: dict[Guest, None] = {}

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
        self._waiting.setdefault(guest)

    def send(self, guest: Guest) -> None:
        """Note that a connection has asked, and sends a body."""
        self._waiting.pop(guest, None)
        self._sending.setdefault(guest)

    def work(self, guest: Guest) -> None:
        """Note that a connection has asked, and waits for the service."""
        self._waiting.pop(guest, None)
        self._sending.pop(guest, None)

    def _make_room(self) -> bool:
        idle = next((guest for guest in self._waiting if guest.is_idle()), None)
        guest = idle or min(self._sending, key=lambda sender: sender.upload_rate(), default=None)
        if guest is None or (guest is not idle and guest.upload_rate() == inf):
            return False
        self.work(guest)
        guest.give_way()
        return True
