"""Speed of this machine: seconds here for each that was predicted, learnt from the jobs."""

from __future__ import annotations

# How much one job's time tells.
LEARNING = 0.2
# Below, a job's time is mostly what goes on around it.
TELLING_SECONDS = 0.05
# Beyond these times what was expected a job tells of its file, not of the machine.
SURPRISE = 2.0
# No machine that serves is so much slower, or faster, than the one that was measured.
MOST = 16.0


class Slowness:
    """A factor for predictions, whatever single jobs take.

    It stands in every client's waiting times: a file that takes a thousand times what was predicted
    must not have everybody else refused for it.
    """

    def __init__(self) -> None:
        self.factor = 1.0

    def learn(self, predicted: float, spent: float) -> None:
        """Compare a prediction with what it came to, in seconds."""
        if spent > TELLING_SECONDS:
            surprise = spent / (predicted * self.factor)
            surprise = min(max(surprise, 1 / SURPRISE), SURPRISE)
            self.factor *= surprise**LEARNING
            self.factor = min(max(self.factor, 1 / MOST), MOST)
