"""Counts of the clients' answers."""

import re
import threading
from collections import Counter, defaultdict

import numpy as np


class Tally:
    """Counts and seconds from many threads."""

    def __init__(self):
        self._lock = threading.Lock()
        self.answers: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.phase = "quiet"
        self._seconds: defaultdict[tuple[str, str], list[float]] = defaultdict(list)

    def answer(self, who, status):
        """A client got an answer."""
        with self._lock:
            self.answers[f"{who} {status}"] += 1

    def mistake(self, what):
        """An answer was not what it must be."""
        with self._lock:
            self.wrong.append(what)

    def took(self, what, seconds):
        """Something took so long, beside the attack that is on."""
        with self._lock:
            self._seconds[what, self.phase].append(seconds)

    def faults(self):
        """Answers that say that the service failed: 5xx but 503, which says when to come again."""
        failed = (name for name in self.answers if re.fullmatch(r".* 5(?!03)\d\d", name))
        return Counter({name: self.answers[name] for name in failed})

    def percentiles(self, what):
        """By phase: how many, and p50, p99 and the longest in milliseconds."""
        with self._lock:
            seconds = {
                phase: times for (name, phase), times in self._seconds.items() if name == what
            }
            return {
                phase: (len(times), *(1000 * np.percentile(times, [50, 99, 100])).tolist())
                for phase, times in seconds.items()
            }
