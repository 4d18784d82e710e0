"""Progress of a refinement, reported while its levels are computed, and of compilation."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from threading import Lock
from typing import Any

from numba.core import event  # pyright: ignore[reportMissingTypeStubs]

from pns_common.kernels import ANNOUNCEMENT

EVENTS: Any = event
# Work of a face of a learned level, and of a limit, in faces that the base scheme makes.
LEARNED_COST, LIMIT_COST = 6, 3
# Seconds between two signs of life of a compilation.
QUIET = 10.0
# Rows that the loops of a level pass for each face that they make.
ROWS_PER_FACE, LEARNED_ROWS_PER_FACE = 2.0, 4.0


class Progress:
    """Turns rows that loops have begun into faces made so far.

    Args:
        children: faces that the first level makes; each later one splits them in four.
        levels: number of levels.
        learned_levels: levels at which a learned rule acts.
        limit: whether the limit surface is computed.
        tell: called with (faces made so far, faces made in the end), by one thread at a time, and
            never with fewer faces than before; an exception that it raises ends the refinement.
    """

    def __init__(
        self,
        children: int,
        levels: int,
        learned_levels: int,
        limit: bool,
        tell: Callable[[int, int], None],
    ) -> None:
        made = [children * 4**level for level in range(levels)]
        learned = [depth < learned_levels for depth in range(levels)]
        self._costs = [n * (LEARNED_COST if is_ else 1) for n, is_ in zip(made, learned)]  # noqa: B905
        self._rows = [
            n * (LEARNED_ROWS_PER_FACE if is_ else ROWS_PER_FACE)
            for n, is_ in zip(made, learned)  # noqa: B905
        ]
        if limit:
            self._costs.append(made[-1] * LIMIT_COST)
            self._rows.append(made[-1])
        self._total, self._spent, self._seen = sum(made), 0, 0
        self._tell, self._lock = tell, Lock()

    def rows(self, count: int) -> None:
        """Count rows of the present level; called from any thread."""
        with self._lock:
            self._seen += count
            within = min(self._seen / self._rows[0], 1.0) if self._rows else 0.0
            self._report(within * self._costs[0] if self._costs else 0.0)

    def level_ends(self) -> None:
        """Count a level, or the limit surface, as done."""
        with self._lock:
            self._spent += self._costs.pop(0)
            self._rows.pop(0)
            self._seen = 0
            self._report(0.0)

    def _report(self, within: float) -> None:
        share = (self._spent + within) / (self._spent + sum(self._costs))
        self._tell(round(self._total * share), self._total)


class Compilation(EVENTS.Listener):
    """Kernels compiled so far, and the seconds that took; tells `announce` about them."""

    def __init__(self, announce: Callable[[str], None]) -> None:
        self.kernels, self.seconds = 0, 0.0
        # How far the whole is, where that is known.
        self.place = ""
        self._announce, self._depth, self._began, self._said = announce, 0, 0.0, 0.0

    def on_start(self, _: object) -> None:
        """Note that a kernel begins; those that it calls are compiled within it, as numba locks."""
        self._depth += 1
        if self._depth > 1:
            return
        self._began = time.perf_counter()
        if not self.kernels:
            self._say(f"{ANNOUNCEMENT}, longer on a busy machine")

    def on_end(self, _: object) -> None:
        """Note that a kernel is compiled."""
        self._depth -= 1
        if self._depth:
            return
        self.kernels += 1
        self.seconds += time.perf_counter() - self._began
        if time.perf_counter() - self._said > QUIET:
            self._say(f"kernels compiled so far: {self.kernels}{self.place}")

    def _say(self, text: str) -> None:
        self._said = time.perf_counter()
        self._announce(text)


@contextmanager
def compiling(announce: Callable[[str], None]) -> Generator[Compilation, None, None]:
    """Announce what is compiled meanwhile, with a sign of life every QUIET seconds; count it."""
    compilation = Compilation(announce)
    with EVENTS.install_listener("numba:compile", compilation):
        yield compilation
