"""How far a refinement is, told while its levels go on."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

# What making a face costs at a level that is learned, and what putting it on the limit surface
# does, where making it by Loop costs 1: measured on 80,000 faces, compiled and not.
LEARNED_COST, LIMIT_COST = 6, 3
# Rows that the passes of a level go over for each face that they make, likewise.
ROWS_PER_FACE, LEARNED_ROWS_PER_FACE = 2.0, 4.0


def level_costs(faces: int, levels: int, learned_levels: int | None) -> list[int]:
    """Return what each level of a refinement costs, in faces that Loop makes.

    Arguments as of ``RefinementProgress``.
    """
    learned = levels if learned_levels is None else learned_levels
    return [
        faces * 4 ** (depth + 1) * (LEARNED_COST if depth < learned else 1)
        for depth in range(levels)
    ]


class Unheard:
    """What is told of a refinement to which nobody listens: nothing is counted."""

    def rows(self, count: int) -> None:
        """Do nothing."""

    def level_ends(self) -> None:
        """Do nothing."""


class RefinementProgress:
    """Faces made so far, as the work goes: a level that costs more counts for more.

    Args:
        faces: those of the control mesh.
        levels: how many levels there are.
        learned_levels: at how many of them the scheme's own rules act; None: at all.
        limit: whether the limit surface is asked for.
        tell: called with (faces made so far, faces made in the end), by one thread at a time, and
            never with fewer faces than before; what it raises ends the refinement.
    """

    def __init__(
        self,
        faces: int,
        levels: int,
        learned_levels: int | None,
        limit: bool,
        tell: Callable[[int, int], None],
    ) -> None:
        made = [faces * 4**level for level in range(1, levels + 1)]
        learned = levels if learned_levels is None else learned_levels
        self._costs = level_costs(faces, levels, learned_levels)
        self._rows = [
            count * (LEARNED_ROWS_PER_FACE if depth < learned else ROWS_PER_FACE)
            for depth, count in enumerate(made)
        ]
        if limit:
            self._costs.append(made[-1] * LIMIT_COST)
            self._rows.append(made[-1])
        self._total = sum(made)
        self._spent, self._seen = 0, 0
        self._tell = tell
        self._lock = Lock()

    def rows(self, count: int) -> None:
        """Take note of so many more rows of the level that are looked at; from any thread."""
        with self._lock:
            self._seen += count
            within = min(self._seen / self._rows[0], 1.0) if self._rows else 0.0
            self._report(within * self._costs[0] if self._costs else 0.0)

    def level_ends(self) -> None:
        """Take note that a level is done, or the limit surface."""
        with self._lock:
            self._spent += self._costs.pop(0)
            self._rows.pop(0)
            self._seen = 0
            self._report(0.0)

    def _report(self, within: float) -> None:
        share = (self._spent + within) / (self._spent + sum(self._costs))
        self._tell(round(self._total * share), self._total)


def refinement_progress(
    faces: int,
    levels: int,
    learned_levels: int | None,
    limit: bool,
    tell: Callable[[int, int], None] | None,
) -> RefinementProgress | Unheard:
    """Return what takes note of a refinement's way; ``tell`` None: nobody listens."""
    if tell is None:
        return Unheard()
    return RefinementProgress(faces, levels, learned_levels, limit, tell)
