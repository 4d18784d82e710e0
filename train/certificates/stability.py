"""T7, Lipschitz stability: moving vertices by ε moves the refined mesh by a multiple of ε."""

from collections.abc import Sequence

import numpy as np

from pns_common import Mesh
from train.certificates.bodies import Body
from train.certificates.certificate import Certificate, Kind, farthest
from train.certificates.scaling import fitted_slope
from train.certificates.step import step
from train.certificates.subject import Subject

# In reference lengths; edges of the bodies are about 0.3 long.
EPSILONS = 10.0 ** -np.arange(2, 8)

# Gates of scale-free rules open within a few degrees: larger moves close and open them.
SMALLER_EPSILONS = 10.0 ** -np.arange(4, 9)

NEAR_ONE = 0.1


def lipschitz_slope(subject: Subject, bodies: Sequence[Body], seed: int) -> Certificate:
    """Measure T7: how the change of the refined mesh grows with a random move of every vertex.

    A slope well below 1 is a jump: the change does not go to nothing with the move.
    """
    rng, measured = np.random.default_rng(seed), []
    epsilons = EPSILONS if subject.learned_once is None else SMALLER_EPSILONS
    for body in bodies:
        move = rng.standard_normal(body.mesh.vertices.shape)
        still = step(subject.exact, body.mesh).positions
        changes = []
        for epsilon in epsilons:
            moved = Mesh(body.mesh.vertices + epsilon * move, body.mesh.faces)
            apart = step(subject.exact, moved).positions - still
            changes.append(np.linalg.norm(apart, axis=1).max())
        measured.append((fitted_slope(epsilons, np.array(changes)), body.name))
    slope, place = farthest(measured, 1.0)
    return Certificate(
        "T7", "Lipschitz slope", slope, 1 - NEAR_ONE, 1 + NEAR_ONE, place, Kind.MEASURED
    )
