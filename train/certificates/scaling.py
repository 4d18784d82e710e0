"""T4 and T6, the orders in h: one mesh scaled down with the reference length held at 1.

Features do not see the scale, so the correction falls as h² exactly, and normals approach Loop's
as h.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from pns_common import Mesh, loop
from train.certificates.bodies import Body
from train.certificates.certificate import Certificate, farthest
from train.certificates.step import step
from train.certificates.subject import Subject
from train.refining import AnyScheme
from train.vectors import face_normals

# Powers of two: scaling is exact. Normals need small ones to be in the linear regime.
SCALES = 2.0 ** -np.arange(4, 11)

# A scale-free rule asks for a share of h: the budget, which falls as h², takes over far below.
SMALLER_SCALES = 2.0 ** -np.arange(18, 25)

Measure = Callable[[AnyScheme, Mesh], float]


def proximity_slope(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify T4: the largest distance from Loop falls with slope 2."""
    return _slope("T4", "proximity slope", 2.0, 1e-3, subject, bodies, distance_from_loop)


def normal_variation_slope(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify T6: the largest difference of a face's normal from Loop's falls with slope 1."""
    return _slope("T6", "normal-variation slope", 1.0, 1e-2, subject, bodies, normals_from_loop)


def distance_from_loop(scheme: AnyScheme, mesh: Mesh) -> float:
    """Return ‖S(M) − S_Loop(M)‖ over all new vertices."""
    apart = step(scheme, mesh).positions - step(loop(), mesh).positions
    return float(np.linalg.norm(apart, axis=1).max())


def normals_from_loop(scheme: AnyScheme, mesh: Mesh) -> float:
    """Return ‖n − n_Loop‖ over all faces of the refined mesh."""
    ours, base = step(scheme, mesh), step(loop(), mesh)
    faces = ours.level.split().numpy()
    apart = face_normals(ours.positions, faces) - face_normals(base.positions, faces)
    return float(np.linalg.norm(apart, axis=1).max())


def fitted_slope(x: Float[np.ndarray, " N"], y: Float[np.ndarray, " N"]) -> float:
    """Return the slope of log y over log x, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def _slope(
    theorem: str,
    name: str,
    expected: float,
    tolerance: float,
    subject: Subject,
    bodies: Sequence[Body],
    measure: Measure,
) -> Certificate:
    low, high = expected - tolerance, expected + tolerance
    scales = SCALES if subject.learned_once is None else SMALLER_SCALES
    slopes = []
    for body in bodies:
        values = np.array(
            [measure(subject.exact, Mesh(s * body.mesh.vertices, body.mesh.faces)) for s in scales]
        )
        # A scheme that is Loop here has no slope, and holds the theorem at any.
        if values.any():
            slope = fitted_slope(scales, values) if values.all() else float("nan")
            slopes.append((slope, body.name))
    if not slopes:
        return Certificate(theorem, name, expected, low, high, "the scheme is Loop on every mesh")
    slope, place = farthest(slopes, expected)
    return Certificate(theorem, name, slope, low, high, place)
