"""Progress of a refinement, reported while its levels are computed."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

# Work of a face of a learned level, and of a limit, in faces that the base scheme makes.
LEARNED_COST, LIMIT_COST = 6, 3
# Rows that the loops of a level pass for each face that they make.
ROWS_PER_FACE, LEARNED_ROWS_PER_FACE = 2.0, 4.0


class Shares:
    """Turns shares of the work into faces made so far, where their number is not yet known.

    Args:
        tell: as of ``Progress``; the faces made in the end are those that the share lets expect.
            None: nothing is reported.
    """

    def __init__(self, tell: Callable[[int, int], None] | None) -> None:
        self._tell, self._share, self._faces = tell, 0.0, 1
        self._begin, self._end = 0.0, 1.0

    def part(self, begin: float, end: float) -> None:
        """Go on from one share of the work to another."""
        self._begin, self._end = begin, end

    def reach(self, share: float, faces: int) -> None:
        """Report a share of the part, and how many faces there are so far."""
        self._share = max(self._share, self._begin + (self._end - self._begin) * share)
        self._faces = max(self._faces, faces)
        if self._share > 0 and self._tell is not None:
            total = max(int(self._faces / self._share), self._faces)
            self._share = self._faces / total
            self._tell(self._faces, total)


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
