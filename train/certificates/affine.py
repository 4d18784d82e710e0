"""T3, affine reproduction: on a plane the scheme is Loop."""

from collections.abc import Sequence

import numpy as np

from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.schemes import loop
from train.certificates.bodies import Body, random_motion
from train.certificates.certificate import Certificate, worst
from train.certificates.plain_loop import plain_loop
from train.certificates.step import departure
from train.certificates.subject import Subject

LEVELS = 2

TURNED = 1e-28
"""Of h²: on a turned plane 1 − n1 · n2 is rounding, about 1e-16, and the gate squares it."""


def affine_reproduction(subject: Subject, flat: Sequence[Body], seed: int) -> list[Certificate]:
    """Certify T3 on planar meshes in z = 0, none folded: exactly on axis-aligned planes, δ on any.

    Folded faces lie in a plane too, but their normals differ; the theorem's mesh has none.
    """
    return [_aligned(subject, flat, seed), _turned(subject, flat, seed)]


def _aligned(subject: Subject, flat: Sequence[Body], seed: int) -> Certificate:
    rng = np.random.default_rng(seed)
    found = []
    for body in flat:
        for axis, name in enumerate(("z", "x", "y")):
            lifted = body.mesh.vertices + np.array([0, 0, rng.uniform(-1, 1)])
            mesh = Mesh(np.roll(lifted, axis, axis=1), body.mesh.faces)
            refined, base = (
                refine(mesh, scheme, LEVELS, 1.0, threads=1).mesh.vertices
                for scheme in (subject.scheme, loop())
            )
            found.append((float(np.abs(refined - base).max()), f"{body.name}, {name} constant"))
    value, place = worst(found)
    return Certificate("T3", "affine reproduction, axis-aligned", value, 0.0, 0.0, place)


def _turned(subject: Subject, flat: Sequence[Body], seed: int) -> Certificate:
    rng = np.random.default_rng(seed)
    found = []
    for body in flat:
        turn, _ = random_motion(rng)
        mesh = Mesh(body.mesh.vertices @ turn.T, body.mesh.faces)
        size = np.linalg.norm(departure(subject.scheme, mesh).displacement, axis=1)
        longest = plain_loop(mesh.vertices, mesh.faces).reach.max()
        found.append((float(size.max() / longest**2), body.name))
    value, place = worst(found)
    return Certificate("T3", "affine reproduction, any plane", value, high=TURNED, where=place)
