"""Limit the time for which a client keeps the service waiting for its body."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Pace:
    """A least rate with three bounds on waiting; times in seconds, the rate in bytes a second.

    `rate` need not be kept from the first byte on: `grace` is how far a client may fall behind.
    """

    rate: float
    grace: float
    idle: float
    whole: float

    def patience(self, moved: int, waited: float) -> float:
        """Return how many more seconds to wait for the next byte.

        `moved` bytes have been moved so far, and the client was waited for `waited` seconds in all.
        Never more than `idle`; zero or less once the client is late.
        """
        return min(self.idle, self.grace + moved / self.rate - waited, self.whole - waited)

    def excuse(self, moved: int, waited: float) -> str:
        """Return what the client that ran out of patience has done."""
        if waited >= self.whole:
            return f"not whole within {self.whole:g} seconds"
        if waited >= self.grace + moved / self.rate:
            return f"slower than {self.rate:g} bytes a second"
        return f"nothing for {self.idle:g} seconds"
