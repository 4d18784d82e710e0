"""Who is connected: at most so many in all, and so many of one address."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import chain, islice
from math import inf
from typing import Protocol

from ..addresses import Network, is_named, site

# Name of the ASGI extension by which an application says that its answer is a stream that the
# client may ask for again: a function to call before it begins.
LISTENS = "pns.listens"

# How many of those that have waited longest are asked whether they are idle, a call of the system
# each: the others, where these are not, came in one burst, and are read at the next turn.
LOOKED_AT = 64


class Guest(Protocol):
    """A connection, as the crowd sees it."""

    def is_idle(self) -> bool:
        """Return whether its client has really said nothing: not even what is yet unread."""
        ...

    def has_left(self) -> bool:
        """Return whether its client says nothing more, and its last words are yet to be read."""
        ...

    def rate(self) -> float:
        """Return the bytes a second that its client sends or takes; infinite while it is early."""
        ...

    def give_way(self) -> None:
        """End at once."""
        ...


class Crowd:
    """The open connections, by address.

    Proxies are exempt from the share of an address: many clients come through one. Where all slots
    are taken, one gives way to a new connection, so that no client locks others out. It is, of
    those that there are, the first of:

    - the oldest whose client has asked for nothing yet;
    - of those that listen to a stream, the oldest of the address with the most connections;
    - the slowest of those that the service waits for, and of equally slow ones the oldest of the
      address with the most connections;
    - the oldest of the address with the most connections, if those are more than the newcomer's.

    Where an address has its share, the oldest of its own whose client has left gives way: a client
    that comes and goes would else lock its neighbours out until the service, busy with others, sees
    it. Not one that has been heard: a client may have ended what it sends, and wait for its answer.
    """

    def __init__(self, most: int, most_of_address: int, proxies: tuple[Network, ...] = ()) -> None:
        self.most = most
        self.most_of_address = most_of_address
        self.proxies = proxies
        self.refused = 0
        # The names of their addresses; None: a proxy's.
        self._names: dict[Guest, str | None] = {}
        self._of_address: Counter[str | None] = Counter()
        # In the order in which they began it.
        self._waiting: dict[Guest, None] = {}
        self._listening: dict[Guest, None] = {}
        self._slow: dict[Guest, None] = {}
        self._working: dict[Guest, None] = {}

    def __len__(self) -> int:
        return len(self._names)

    def enter(self, guest: Guest, address: str) -> str | None:
        """Take a slot for a connection; where there is none, say why and take none."""
        name = None if is_named(address, self.proxies) else site(address)
        if (
            name is not None
            and self._of_address[name] >= self.most_of_address
            and not self._give_way(self._who_left(name))
        ):
            self.refused += 1
            return f"{self.most_of_address} connections of your address are open"
        if len(self) >= self.most and not self._make_room(name):
            self.refused += 1
            return f"{self.most} connections are open"
        self._names[guest] = name
        self._of_address[name] += 1
        self._waiting[guest] = None
        return None

    def leave(self, guest: Guest) -> None:
        """Give the slot of a connection back, where it has one."""
        if guest in self._names:
            self._forget(guest)
            name = self._names.pop(guest)
            self._of_address[name] -= 1
            if not self._of_address[name]:
                del self._of_address[name]

    def wait(self, guest: Guest) -> None:
        """Note that a connection asks for nothing."""
        self._move(guest, self._waiting)

    def listen(self, guest: Guest) -> None:
        """Note that a connection takes a stream that its client may ask for again."""
        self._move(guest, self._listening)

    def attend(self, guest: Guest) -> None:
        """Note that a connection has asked, and that the service waits for its client."""
        self._move(guest, self._slow)

    def work(self, guest: Guest) -> None:
        """Note that a connection has asked, and waits for the service."""
        self._move(guest, self._working)

    def _move(self, guest: Guest, to: dict[Guest, None]) -> None:
        if guest in self._names and guest not in to:
            self._forget(guest)
            to[guest] = None

    def _forget(self, guest: Guest) -> None:
        for state in (self._waiting, self._listening, self._slow, self._working):
            state.pop(guest, None)

    def _make_room(self, newcomer: str | None) -> bool:
        mine = 0 if newcomer is None else self._of_address[newcomer]
        guest = (
            next((guest for guest in islice(self._waiting, LOOKED_AT) if guest.is_idle()), None)
            or self._greediest(self._listening)
            or self._slowest()
            or self._greediest(chain(self._working, self._slow, self._waiting), more_than=mine + 1)
        )
        return self._give_way(guest)

    def _give_way(self, guest: Guest | None) -> bool:
        if guest is None:
            return False
        self._forget(guest)
        guest.give_way()
        return True

    def _who_left(self, name: str) -> Guest | None:
        """Return the oldest of an address whose client has left, unheard or a listener."""
        free = chain(self._waiting, self._listening)
        own = (guest for guest in free if self._names[guest] == name)
        return next((guest for guest in own if guest.has_left()), None)

    def _slowest(self) -> Guest | None:
        """Return the slowest, where there is one whose rate can be told."""
        rates = {guest: guest.rate() for guest in self._slow}
        told = [guest for guest, rate in rates.items() if rate < inf]
        return min(told, key=lambda guest: (rates[guest], -self._held_with(guest)), default=None)

    def _greediest(self, guests: Iterable[Guest], more_than: int = -1) -> Guest | None:
        """Return the oldest of the address with most connections, if those are more than that."""
        guest = max(guests, key=self._held_with, default=None)
        return guest if guest is not None and self._held_with(guest) > more_than else None

    def _held_with(self, guest: Guest) -> int:
        """Return how many connections its address has; none that count, where it is a proxy's."""
        name = self._names[guest]
        return 0 if name is None else self._of_address[name]
