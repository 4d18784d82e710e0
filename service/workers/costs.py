"""What a job will cost: a prediction, for the order of jobs and for the budgets of clients."""

from __future__ import annotations

from dataclasses import dataclass

# Seconds of one core, measured on files of 8,000 to 2,000,000 refined faces in 1 to 1000 meshes: a
# request, a byte of the upload, a mesh, a refined face, and what one of learned levels takes more.
SECONDS = 0.01
SECONDS_PER_BYTE = 2e-8
SECONDS_PER_MESH = 5e-4
SECONDS_PER_FACE = 1.2e-6
SECONDS_PER_LEARNED_FACE = 2e-6


@dataclass(frozen=True, slots=True)
class Cost:
    """A prediction: refined faces, meshes, and seconds of one core."""

    faces: int
    meshes: int
    seconds: float


def cost_of(faces: int, meshes: int, size: int, learned: int = 0) -> Cost:
    """The cost of so many refined faces and meshes, from an upload of `size` bytes.

    `learned` are the faces after the last level at which a model acts.
    """
    seconds = SECONDS + SECONDS_PER_BYTE * size + SECONDS_PER_MESH * meshes
    seconds += SECONDS_PER_FACE * faces + SECONDS_PER_LEARNED_FACE * learned
    return Cost(faces, meshes, seconds)
