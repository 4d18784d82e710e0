"""T3, affine reproduction: on a plane the scheme is Loop."""

from collections.abc import Sequence

import numpy as np

from pns_common.formula.curve_prior import on_boundary
from pns_common.mesh import Mesh
from pns_common.schemes import loop
from train.certificates.bodies import Body, random_motion
from train.certificates.certificate import Certificate, worst
from train.certificates.plain_loop import plain_loop
from train.certificates.step import departure
from train.certificates.subject import Subject
from train.refining import AnyScheme, refine

LEVELS = 2

# Of h²: on a turned plane 1 − n1 · n2 is rounding, about 1e-16, and the gate squares it.
TURNED = 1e-28

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
            mesh = Mesh(np.roll(lifted, axis, axis=1), body.mesh.faces)
            off = _off_loop(subject.scheme, mesh, axis)
            measured.append((off, f"{body.name}, {name} constant"))
    value, place = worst(measured)
    return Certificate("T3", "affine reproduction, axis-aligned", value, 0.0, 0.0, place)


def _off_loop(scheme: AnyScheme, mesh: Mesh, axis: int) -> float:
    """Return how far planar refinements are from Loop's; but for boundaries where these move.

    These stay in the plane: there the coordinate across it is compared, everything else at the
    first level.
    """
    refined, base = (refine(mesh, rules, LEVELS, 1.0).mesh.vertices for rules in (scheme, loop()))
    if not scheme.moves_boundaries:
        return float(np.abs(refined - base).max())
    across = (axis + 2) % 3
    first = departure(scheme, mesh)
    inside = first.displacement[~on_boundary(first.topology)]
    out_of_plane = np.abs(refined[:, across] - base[:, across]).max()
    return float(max(np.abs(inside).max(initial=0), out_of_plane))


def _turned(subject: Subject, flat: Sequence[Body], seed: int) -> Certificate:
    rng, measured = np.random.default_rng(seed), []
    scale_free = subject.scheme.guard is not None
    for body in flat:
        turn, _ = random_motion(rng)
        mesh = Mesh(body.mesh.vertices @ turn.T, body.mesh.faces)
        found_step = departure(subject.scheme, mesh)
        size = np.linalg.norm(found_step.displacement, axis=1)
        if subject.scheme.moves_boundaries:
            size = size[~on_boundary(found_step.topology)]
        longest = plain_loop(mesh.vertices, mesh.faces).reach.max()
        measured.append((float(size.max() / longest ** (1 if scale_free else 2)), body.name))
    value, place = worst(measured)
    allowed = TURNED_IN_EDGE_LENGTHS if scale_free else TURNED
    return Certificate("T3", "affine reproduction, any plane", value, high=allowed, where=place)
