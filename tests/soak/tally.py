"""Counts of the clients' answers."""

from __future__ import annotations

import threading
from collections import Counter, defaultdict

import numpy as np


class Tally:
    """Counts and seconds from many threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.answers: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.phase = "quiet"
        self._seconds: defaultdict[tuple[str, str], list[float]] = defaultdict(list)

    def answer(self, who: str, status: int) -> None:
        """A client got an answer."""
        with self._lock:
            self.answers[f"{who} {status}"] += 1

    def mistake(self, what: str) -> None:
        """An answer was not what it must be."""
        with self._lock:
            self.wrong.append(what)

    def took(self, what: str, seconds: float) -> None:
        """Something took so long, beside the attack that is on."""
        with self._lock:
            self._seconds[what, self.phase].append(seconds)

    def faults(self) -> Counter[str]:
        """Answers that say that the service failed: 5xx but 503, which says when to come again."""
        return Counter(
            {
                name: count
                for name, count in self.answers.items()
                if name.split()[-1].startswith("5") and not name.endswith("503")
            }
        )

    def percentiles(self, what: str) -> dict[str, tuple[int, float, float, float]]:
        """By phase: how many, and p50, p99 and the longest in milliseconds."""
        with self._lock:
            samples = {
                phase: 1000 * np.array(seconds)
                for (name, phase), seconds in self._seconds.items()
                if name == what and seconds
            }
        return {
            phase: (
                len(values),
                float(np.percentile(values, 50)),
                float(np.percentile(values, 99)),
                float(values.max()),
            )
            for phase, values in samples.items()
        }
