"""T4 to T7: the orders in h, normals that settle, and a bounded answer to small moves.

T4 is an upper bound, and holds on each mesh as it stands. The slopes of T4 and T6 scale one mesh
down with the reference length held at 1: features do not see the scale, so the correction falls as
h² exactly, and normals approach the base scheme's as h. (Refining a surface also flattens its
edges, which shuts gates.) T5 is measured, not proved: C¹ limits show in the refined meshes, where
the angle between neighbouring faces goes to nothing. T7 moves vertices by ε, which moves the
refined mesh by a multiple of ε.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.certificates.bodies import Body
from train.certificates.displacement import AT_MOST
from train.certificates.step import rounding, step
from train.certificates.subject import Certificate, Kind, Subject, farthest, worst
from train.refining import figures, refine
from train.vectors import face_normals

# Powers of two: scaling is exact. Normals need small ones to be in the linear regime.
SCALES = 2.0 ** -np.arange(4, 11)

# A scale-free rule asks for a share of h: the budget, which falls as h², takes over far below.
SMALLER_SCALES = 2.0 ** -np.arange(18, 25)

SAME_AS_BASE = "the scheme is its base on every mesh"

Measure = Callable[[Subject, Mesh], float]


def proximity(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify T4 as it stands; the value is the largest `proximity_ratio`."""
    ratio, place = worst([(proximity_ratio(subject, body.mesh), body.name) for body in bodies])
    return Certificate("T4", "proximity", ratio, high=AT_MOST, where=place)


def proximity_ratio(subject: Subject, mesh: Mesh) -> float:
    """Return ‖S(M) − S_base(M)‖ / (C h(M)² / R) at R = 1; h(M) is the longest edge.

    The base is an independent one.
    """
    base = subject.base.plain(mesh.vertices, mesh.polygons).positions
    apart = np.linalg.norm(step(subject.scheme, mesh).positions - base, axis=1).max()
    starts, ends = mesh.vertices[mesh.topology().edges.astype(np.int64).T]
    longest = np.linalg.norm(ends - starts, axis=1).max()
    return float(apart / (subject.budget * longest**2 + rounding(mesh)))


def proximity_slope(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify that h² is the order of T4: shrunk with R held, a mesh nears its base by slope 2."""
    return _slope("T4", "proximity slope", 2.0, 1e-3, subject, bodies, distance_from_base)


def normal_variation_slope(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify T6: the largest difference of a face's normal from the base's falls with slope 1."""
    return _slope("T6", "normal-variation slope", 1.0, 1e-2, subject, bodies, normals_from_base)


def distance_from_base(subject: Subject, mesh: Mesh) -> float:
    """Return ‖S(M) − S_base(M)‖ over all new vertices."""
    apart = step(subject.exact, mesh).positions - step(subject.base.scheme, mesh).positions
    return float(np.linalg.norm(apart, axis=1).max())


def normals_from_base(subject: Subject, mesh: Mesh) -> float:
    """Return ‖n − n_base‖ over all triangles of the refined mesh."""
    triangles = subject.base.plain(mesh.vertices, mesh.polygons).triangles
    ours, base = (
        face_normals(step(rules, mesh).positions, triangles)
        for rules in (subject.exact, subject.base.scheme)
    )
    apart = ours - base
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
            [measure(subject, Mesh(s * body.mesh.vertices, body.mesh.polygons)) for s in scales]
        )
        # A scheme that is its base here has no slope, and holds the theorem at any.
        if values.any():
            slope = fitted_slope(scales, values) if values.all() else float("nan")
            slopes.append((slope, body.name))
    if not slopes:
        return Certificate(theorem, name, expected, low, high, SAME_AS_BASE)
    slope, place = farthest(slopes, expected)
    return Certificate(theorem, name, slope, low, high, place)


LEVELS = 5

AT_LEAST = 0.5


def regular_smoothness(subject: Subject, torus: Mesh) -> Certificate:
    """Measure T5 on a mesh whose vertices are all regular: the order at which normals settle.

    The value is the fall of the largest face-normal jump from the last level but one to the last,
    in powers of two; 1 for a base scheme. Edges that a scheme finds sharp are no regular regions:
    none is kept.
    """
    refined = refine(torus, subject.scheme, LEVELS, 1.0, creases=None)
    jumps = np.array([level.normal_jump for level in figures(refined)])
    order = float(np.log2(jumps[-2] / jumps[-1])) if jumps[-1] > 0 else np.inf
    where = f"bumpy torus, level {LEVELS}: largest jump {np.degrees(jumps[-1]):.1f}°"
    name = "normals settle in regular regions"
    return Certificate("T5", name, order, low=AT_LEAST, where=where, kind=Kind.MEASURED)


# In reference lengths; edges of the bodies are about 0.3 long.
EPSILONS = 10.0 ** -np.arange(2, 8)

# Gates of scale-free rules open within a degree, and their guard acts by halves: larger moves
# close and open them.
SMALLER_EPSILONS = 10.0 ** -np.arange(5, 10)

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
            moved = Mesh(body.mesh.vertices + epsilon * move, body.mesh.polygons)
            apart = step(subject.exact, moved).positions - still
            changes.append(np.linalg.norm(apart, axis=1).max())
        measured.append((fitted_slope(epsilons, np.array(changes)), body.name))
    slope, place = farthest(measured, 1.0)
    return Certificate(
        "T7", "Lipschitz slope", slope, 1 - NEAR_ONE, 1 + NEAR_ONE, place, Kind.MEASURED
    )
