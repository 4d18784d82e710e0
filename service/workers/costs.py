"""Predict the cost of jobs, for their order and for budgets; learn how slow the machine is."""

from __future__ import annotations

from dataclasses import dataclass

# Seconds of one core, measured on files of 8,000 to 2,000,000 refined faces in 1 to 1000 meshes: a
# request, a byte of the upload, a value of its JSON, a primitive, a refined face, what one of
# learned levels takes more, and each further attribute or morph target of one (of 100 to 4,000 on
# 20,480 faces).
SECONDS = 0.01
SECONDS_PER_BYTE = 2e-8
SECONDS_PER_ITEM = 5e-7
SECONDS_PER_PRIMITIVE = 5e-4
SECONDS_PER_FACE = 1.2e-6
SECONDS_PER_LEARNED_FACE = 2e-6
SECONDS_PER_VALUE = 1.4e-7
# How much one job's time tells.
LEARNING = 0.2
# Below, a job's time is mostly what goes on around it.
TELLING_SECONDS = 0.05
# Beyond these times what was expected a job tells of its file, not of the machine.
SURPRISE = 2.0
# No machine that serves is so much slower, or faster, than the one that was measured.
MOST = 16.0


@dataclass(frozen=True, slots=True)
class Cost:
    """A prediction: refined faces, primitives, and seconds of one core.

    `most`: of what was not looked into, it is the most that may come.
    """

    faces: int
    primitives: int
    seconds: float
    most: bool = False


def cost_of(
    faces: int, primitives: int, size: int, learned: int = 0, values: int = 0, items: int = 0
) -> Cost:
    """Return the cost of so many refined faces and primitives, from an upload of `size` bytes.

    `learned` are the faces after the last level at which a model acts; `values` what refined faces
    carry beside the usual attributes, an attribute or morph target of a face each; `items` what the
    JSON holds.
    """
    seconds = SECONDS + SECONDS_PER_BYTE * size + SECONDS_PER_PRIMITIVE * primitives
    seconds += SECONDS_PER_FACE * faces + SECONDS_PER_LEARNED_FACE * learned
    seconds += SECONDS_PER_VALUE * values + SECONDS_PER_ITEM * items
    return Cost(faces, primitives, seconds)


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
