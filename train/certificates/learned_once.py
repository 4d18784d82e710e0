"""Certificates of schemes that correct at the control mesh and are Loop afterwards.

Fold-free, limit distance, smoothness class and resolution independence: docs/theorems.md proves
them for the scale-free rule and any weights.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import Creases, Mesh, Scheme, loop
from pns_common import refine as refine_by_library
from train.certificates.bodies import Body
from train.certificates.plain_loop import plain_loop
from train.certificates.step import rounding, step, trials
from train.certificates.subject import Certificate, Subject, worst
from train.connectivity import connect
from train.refining import AnyScheme, refine

# Child faces that Loop makes flatter than this, in squared edge lengths, have no direction.
FLAT = 1e-9
# In degrees: what positions rounded to doubles may turn a face by.
ROUNDING_ANGLE = 1e-5

SAME = 1e-12
SCALES = (2.0**-12, 2.0**-3, 2.0**5)


def fold_free(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify that no child face turns by more than θ from Loop's with the same creases.

    The value is the largest turn in degrees.
    """
    card = subject.learned_once
    angle = math.nan if card is None or card.fold_angle is None else card.fold_angle
    measured = []
    for trial in trials(subject, bodies, seed):
        base = plain_loop(trial.mesh.vertices, trial.mesh.faces, trial.creases).positions
        made = step(subject.scheme, trial.mesh, creases=trial.creases)
        faces = made.level.split().numpy()
        measured.append((largest_turn(faces, base, made.positions), trial.name))
    turn, place = worst(measured)
    return Certificate("folds", "fold-free", turn, high=angle + ROUNDING_ANGLE, where=place)


def neighbour_turns(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify that no two neighbouring child faces turn by more than 2 θ beyond Loop's pair.

    The value is the largest excess in degrees. It follows from `fold_free` by the triangle
    inequality on the sphere of normals.
    """
    card = subject.learned_once
    angle = math.nan if card is None or card.fold_angle is None else card.fold_angle
    measured = []
    for trial in trials(subject, bodies, seed):
        base = plain_loop(trial.mesh.vertices, trial.mesh.faces, trial.creases).positions
        made = step(subject.scheme, trial.mesh, creases=trial.creases)
        faces = made.level.split().numpy()
        children = connect(faces, len(base))
        pairs = (children.half_edges[children.paired] // 3).numpy()
        measured.append((largest_excess(faces, pairs, base, made.positions), trial.name))
    excess, place = worst(measured)
    high = 2 * (angle + ROUNDING_ANGLE)
    return Certificate("turns", "turns of neighbours", excess, high=high, where=place)


def largest_excess(
    faces: Int[np.ndarray, "F 3"],
    pairs: Int[np.ndarray, "N 2"],
    before: Float[np.ndarray, "V 3"],
    after: Float[np.ndarray, "V 3"],
) -> float:
    """Return by how much an angle between two faces' normals grew at most, in degrees.

    Pairs with a face that had no area before are left out. 180 for NaN.
    """
    vectors, defined = _area_vectors(faces, before, after)
    old, new = (_angle(*vector[pairs].transpose(1, 0, 2)) for vector in vectors)
    grown = (new - old)[defined[pairs].all(axis=1)]
    return float(np.max(np.where(np.isnan(grown), 180.0, grown), initial=0.0))


def largest_turn(
    faces: Int[np.ndarray, "F 3"], before: Float[np.ndarray, "V 3"], after: Float[np.ndarray, "V 3"]
) -> float:
    """Return the largest angle of a face's normals before and after, in degrees; 180 for NaN."""
    vectors, defined = _area_vectors(faces, before, after)
    angle = _angle(*vectors)[defined]
    return float(np.max(np.where(np.isnan(angle), 180.0, angle), initial=0.0))


def _area_vectors(
    faces: Int[np.ndarray, "F 3"], before: Float[np.ndarray, "V 3"], after: Float[np.ndarray, "V 3"]
) -> tuple[list[Float[np.ndarray, "F 3"]], Bool[np.ndarray, " F"]]:
    """Return area vectors before and after, and which faces have an area before."""
    vectors, longest = [], []
    for points in (before, after):
        a, b, c = points[faces].transpose(1, 0, 2)
        vectors.append(np.cross(b - a, c - a))
        longest.append(np.maximum(np.sum((b - a) ** 2, axis=1), np.sum((c - a) ** 2, axis=1)))
    return vectors, np.linalg.norm(vectors[0], axis=1) > FLAT * longest[0]


def _angle(u: Float[np.ndarray, "N 3"], v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Return angles in degrees by an arctangent: an arc cosine would round small ones away."""
    sine = np.linalg.norm(np.cross(u, v), axis=1)
    return np.degrees(np.arctan2(sine, np.sum(u * v, axis=1)))


def limit_distance(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify that the report of two levels bounds the distance from Loop's limit surface.

    The value is the largest distance between the two limits at common parameters, as a fraction of
    what the report says; and what it says must be no more than the budget's bound, which it comes
    near where the budget cuts off. Creases are sharp at one level.
    """
    measured = []
    for trial in trials(subject, bodies, seed):
        creases: Creases | Literal["auto"] = "auto"
        if len(trial.creases):
            creases = Creases(trial.creases, levels=1)
        assert isinstance(subject.scheme, Scheme)
        refined = partial(refine_by_library, trial.mesh, threads=1)
        ours = refined(subject.scheme, 2, 1.0, limit=True, creases=creases)
        theirs = refined(loop(), 2, 1.0, limit=True, creases=Creases())
        apart = np.linalg.norm(ours.mesh.vertices - theirs.mesh.vertices, axis=1).max()
        stated, bound = (ours.report[key] for key in ("limit_distance", "limit_distance_bound"))
        assert stated is not None
        slack = rounding(trial.mesh)
        measured.append((float(apart) / (stated + slack), trial.name))
        if bound is not None:
            measured.append((stated / (bound * (1 + SAME) + slack), f"{trial.name}, bound"))
    ratio, place = worst(measured)
    return Certificate("limit", "limit distance", ratio, high=1 + SAME, where=place)


def smoothness_class(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify that the rule becomes Loop's: its limits are C² off extraordinary points.

    It does after the control mesh, or later where it keeps creases for longer. The value is the
    largest difference from an independent Loop at the level after, in the mesh's extents; NaN for a
    scheme that never stops to correct.
    """
    name, card = "smoothness class", subject.learned_once
    if card is None:
        return Certificate("class", name, math.nan, high=SAME, where="corrects at every level")
    first = max(1, card.sharpness_levels or 0)
    measured = []
    for body in bodies:
        last, after = (
            refine(body.mesh, subject.scheme, count, 1.0).mesh for count in (first, first + 1)
        )
        expected = plain_loop(last.vertices, last.faces).positions
        extent = np.ptp(last.vertices, axis=0).max()
        measured.append((float(np.abs(after.vertices - expected).max() / extent), body.name))
    value, place = worst(measured)
    return Certificate("class", name, value, high=SAME, where=place)


def resolution_independence(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify that what is learned is in units of h: without the budget, scaling a mesh scales δ.

    R stays what it is. A rule in units of h² / R fails: it is right at one resolution alone. The
    value is the largest relative difference.
    """
    assert subject.unbounded is not None
    measured = []
    for body in bodies:
        own = _displacement(subject.unbounded, body.mesh)
        size = np.abs(own).max()
        if size == 0:
            continue
        for scale in SCALES:
            scaled = Mesh(scale * body.mesh.vertices, body.mesh.faces)
            apart = _displacement(subject.unbounded, scaled) / scale - own
            measured.append((float(np.abs(apart).max() / size), f"{body.name}, times {scale:g}"))
    value, place = worst(measured) if measured else (0.0, "the scheme is Loop on every mesh")
    return Certificate("scale", "resolution independence", value, high=SAME, where=place)


def _displacement(scheme: AnyScheme, mesh: Mesh) -> Float[np.ndarray, "N 3"]:
    return step(scheme, mesh).positions - step(loop(), mesh).positions
