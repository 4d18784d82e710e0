"""T1, bounded displacement: no vertex leaves the base scheme's by more than C h² / R.

h is the edge's length at an edge vertex, and the root mean square edge around an old vertex or of a
face; irregular edges, and the vertices on them, are not moved at all, nor are boundaries and
creases but by a rule of their own, within the lengths of their own edges. The theorem is about what
is added to the base scheme with the same creases: with none, and with a quarter of all edges,
whichever they are. So no creases are looked for.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh
from train.certificates.bodies import Body
from train.certificates.plain import PlainStep
from train.certificates.step import NO_CREASES, rounding, trials
from train.certificates.subject import Certificate, Subject, worst
from train.refining import refine

# Faces up to which a mesh is refined further.
LARGEST = 20_000

AT_MOST = 1 + 1e-12


def bounded_displacement(
    subject: Subject, bodies: Sequence[Body], levels: int = 3, seed: int = 0
) -> Certificate:
    """Certify T1 from output positions and an independent base, at every level; R is 1.

    The value is the largest proximity ratio; positions may be off by their rounding.
    """
    measured = []
    for trial in trials(subject, bodies, seed):
        ratio, place, mesh = _one_step(subject, trial.mesh, trial.creases)
        measured.append((ratio, f"{trial.name}, {place}"))
        for level in range(2, levels + 1):
            if len(trial.creases) or mesh.face_count > LARGEST:
                break
            ratio, place, mesh = _one_step(subject, mesh, NO_CREASES)
            measured.append((ratio, f"{trial.name}, level {level}, {place}"))
    ratio, place = worst(measured)
    return Certificate("T1", "bounded displacement", ratio, high=AT_MOST, where=place)


def _one_step(
    subject: Subject, mesh: Mesh, creases: Int[np.ndarray, "N 2"]
) -> tuple[float, str, Mesh]:
    """Refine once; return the largest ratio, at which vertex, and the refined mesh."""
    refined = refine(mesh, subject.scheme, 1, 1.0, creases=creases).mesh
    base = subject.base.plain(mesh.vertices, mesh.polygons, creases)
    ratio, place = worst_ratio(
        mesh, refined.vertices, subject.budget, base, moves_curves=subject.moves_curves
    )
    return ratio, place, refined


def worst_ratio(
    control: Mesh,
    refined: Float[np.ndarray, "N 3"],
    curvature: float,
    base: PlainStep,
    *,
    moves_curves: bool = False,
) -> tuple[float, str]:
    """Return the largest ratio ‖p − p_base‖ / (C h² / R) of one step, and at which vertex.

    ``curvature`` is C / R; ``moves_curves`` says whether boundaries and creases have a rule of
    their own.
    """
    apart = np.linalg.norm(refined - base.positions, axis=1)
    reach = base.reach + base.curve_reach if moves_curves else base.reach
    ratio = apart / (curvature * reach**2 + rounding(control))
    place = int(np.argmax(ratio))  # numpy's argmax finds a NaN first
    return float(ratio[place]), base.labels[place]
