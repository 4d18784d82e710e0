"""T3, affine reproduction: on a plane the scheme is its base."""

from collections.abc import Sequence

import numpy as np

from pns_common import Mesh
from train.certificates.bodies import Body, random_motion
from train.certificates.step import step
from train.certificates.subject import Certificate, Subject, worst
from train.refining import refine

LEVELS = 2

# Of h²: on a turned plane 1 − n1 · n2 is rounding, about 1e-16, and the gate squares it.
TURNED = 1e-28

# Where corners of a border blend masks, the mean of equal numbers is rounded.
MEANS = 1e-15

# Of h: the same where a gate as sharp as 1e6 stands before a displacement in units of h.
TURNED_IN_EDGE_LENGTHS = 1e-20


def affine_reproduction(subject: Subject, flat: Sequence[Body], seed: int) -> list[Certificate]:
    """Certify T3 on planar meshes in z = 0, none folded: exactly on axis-aligned planes, δ on any.

    Folded faces lie in a plane too, but their normals differ; the theorem's mesh has none.
    """
    return [_aligned(subject, flat, seed), _turned(subject, flat, seed)]


def _aligned(subject: Subject, flat: Sequence[Body], seed: int) -> Certificate:
    rng = np.random.default_rng(seed)
    measured = []
    for body in flat:
        for axis, name in enumerate(("z", "x", "y")):
            lifted = body.mesh.vertices + np.array([0, 0, rng.uniform(-1, 1)])
            mesh = Mesh(np.roll(lifted, axis, axis=1), body.mesh.polygons)
            off = _off_base(subject, mesh, axis)
            measured.append((off, f"{body.name}, {name} constant"))
    value, place = worst(measured)
    high = MEANS if subject.moves_curves else 0.0
    return Certificate("T3", "affine reproduction, axis-aligned", value, 0.0, high, place)


def _off_base(subject: Subject, mesh: Mesh, axis: int) -> float:
    """Return how far planar refinements are from the base's; but for boundaries where these move.

    These stay in the plane: there the coordinate across it is compared, everything else at the
    first level.
    """
    refined, base = (
        refine(mesh, rules, LEVELS, 1.0, creases="auto").mesh.vertices
        for rules in (subject.scheme, subject.base.scheme)
    )
    if not subject.moves_curves:
        return float(np.abs(refined - base).max())
    across = (axis + 2) % 3
    first, plain = (step(rules, mesh).positions for rules in (subject.scheme, subject.base.scheme))
    inside = subject.base.plain(mesh.vertices, mesh.polygons).curve_reach == 0
    out_of_plane = np.abs(refined[:, across] - base[:, across]).max()
    return float(max(np.abs(first - plain)[inside].max(initial=0), out_of_plane))


def _turned(subject: Subject, flat: Sequence[Body], seed: int) -> Certificate:
    rng, measured = np.random.default_rng(seed), []
    for body in flat:
        turn, _ = random_motion(rng)
        mesh = Mesh(body.mesh.vertices @ turn.T, body.mesh.polygons)
        plain = subject.base.plain(mesh.vertices, mesh.polygons)
        envelope = subject.budget * plain.reach**2
        size = step(subject.scheme, mesh).added(subject.base.scheme, envelope)
        if subject.moves_curves:
            size = size[plain.curve_reach == 0]
        power = 2 if subject.learned_once is None else 1
        measured.append((float(size.max() / plain.reach.max() ** power), body.name))
    value, place = worst(measured)
    allowed = TURNED if subject.learned_once is None else TURNED_IN_EDGE_LENGTHS
    return Certificate("T3", "affine reproduction, any plane", value, high=allowed, where=place)
