"""Room for results: which of them go where one more does not fit, and which is refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ...errors import BusyError

# Shares of the room for results whose promised time is not over: of a client (in IPv6 a /64), and
# of a /56 and a /48 that it is in.
SHARES = (0.5, 0.625, 0.75)


@dataclass(frozen=True, slots=True)
class Kept:
    """A job that has ended.

    Attributes:
        networks: what it counts for: its client, and the wider networks of its address.
        size: bytes of its result.
        done: whether it has one.
        fetched: whether somebody has it.
        promised: whether it must stay: not fetched yet, and its least time is not over.
    """

    networks: tuple[str, ...]
    size: int
    done: bool
    fetched: bool
    promised: bool


@dataclass(frozen=True, slots=True)
class Room:
    """Room for `max_jobs` jobs that have ended, and `max_bytes` of their results."""

    max_bytes: int
    max_jobs: int

    def check(self, kept: Iterable[Kept], networks: tuple[str, ...], size: int = 0) -> None:
        """Raise BusyError where promised results leave no room, or these networks no share."""
        promised = [one for one in kept if one.promised]
        jobs, sizes = _held(promised)
        for network, share in zip(networks, SHARES, strict=False):
            many = jobs[network] + 1 > max(1, self.max_jobs * share)
            # The first result of a client is never an unfair share.
            large = sizes[network] and sizes[network] + size > self.max_bytes * share
            if many or large:
                raise BusyError("results of this client that wait leave no room", retry_after=60)
        full = sum(one.size for one in promised) + size > self.max_bytes
        if full or len(promised) >= self.max_jobs:
            raise _full()

    def leaving(self, kept: Mapping[str, Kept], networks: tuple[str, ...], size: int) -> list[str]:
        """Return the jobs of `kept` to strike out for a result of so many bytes.

        Raises BusyError where it has no room all the same.
        """
        if size:
            self.check(kept.values(), networks, size)
        left, gone = dict(kept), []
        while left:
            too_large = sum(one.size for one in left.values()) + size > self.max_bytes
            if not too_large and len(left) < self.max_jobs:
                break
            gone.append(_next_to_go(left, by_size=too_large))
            del left[gone[-1]]
        return gone


def _next_to_go(kept: Mapping[str, Kept], *, by_size: bool) -> str:
    """Choose the job to strike out. Raises BusyError."""
    free = [name for name, one in kept.items() if not one.promised]
    if not free:
        raise _full()
    jobs, sizes = _held(kept.values())

    def rank(name: str) -> tuple[bool, bool, int, int]:
        one = kept[name]
        client = one.networks[0]
        most, least = (sizes[client], 0) if by_size else (jobs[client], one.size)
        return not one.done, one.fetched, most, -least

    # The first of equals is the oldest.
    return max(free, key=rank)


def _held(kept: Iterable[Kept]) -> tuple[Counter[str], Counter[str]]:
    """Count jobs and bytes by network."""
    jobs: Counter[str] = Counter()
    sizes: Counter[str] = Counter()
    for one in kept:
        jobs.update(one.networks)
        sizes.update(dict.fromkeys(one.networks, one.size))
    return jobs, sizes


def _full() -> BusyError:
    return BusyError("results that wait to be fetched leave no room", retry_after=60)
