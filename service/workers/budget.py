"""A budget of faces a minute for each client."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..errors import BusyError

MINUTE = 60.0


class OverBudgetError(BusyError):
    """The client has asked for more faces than it may in a minute."""

    status = 429
    code = "over-budget"
    title = "The client's budget of faces is used up"


class FacesBudget:
    """Token buckets: each refills evenly and holds a minute's worth.

    A job larger than a whole minute's worth runs once the bucket is full, and leaves a debt.
    `now` is a clock in seconds.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        # For each client what it has used, when that was last counted, and its faces a minute; who
        # has used nothing is not kept, so that strangers take no memory for longer than a minute or
        # their debt.
        self._used: dict[str, tuple[float, float, float]] = {}

    def charge(self, client: str, faces: int, per_minute: float | None) -> None:
        """Take a job's faces from a client's budget; None is no limit.

        Raises:
            OverBudgetError: there is not enough left; `retry_after` says when there will be.
        """
        if per_minute is None:
            return
        used = self._used_by(client)
        missing = used + min(faces, per_minute) - per_minute
        if missing > 0:
            raise OverBudgetError(
                f"{faces} faces are asked for, {max(per_minute - used, 0):.0f} of {per_minute:.0f} "
                "a minute are left",
                retry_after=int(missing / per_minute * MINUTE) + 1,
            )
        if len(self._used) > 10_000:
            self._used = {
                name: own for name, own in self._used.items() if self._still_used(own) > 0
            }
        self._keep(client, used + faces, per_minute)

    def settle(self, client: str, faces: int, per_minute: float | None) -> None:
        """Take what a job made beyond what it was charged for; below 0 it is given back."""
        if per_minute is not None:
            self._keep(client, max(self._used_by(client) + faces, 0.0), per_minute)

    def _keep(self, client: str, used: float, per_minute: float) -> None:
        self._used[client] = (used, self._now(), per_minute)

    def _used_by(self, client: str) -> float:
        return self._still_used(self._used[client]) if client in self._used else 0.0

    def _still_used(self, entry: tuple[float, float, float]) -> float:
        used, then, per_minute = entry
        return max(used - (self._now() - then) * per_minute / MINUTE, 0.0)
