"""Certificates of schemes that correct at the control mesh and are the base scheme afterwards.

Fold-free, limit distance, smoothness class, resolution independence, numbering and locality, of the
rule of directed edges and any weights: docs/explanation/guarantees.md proves them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import scipy.sparse as sparse
from jaxtyping import Bool, Float, Int

from pns_common import Creases, Mesh, Scheme
from pns_common import refine as refine_by_library
from pns_common.operator.formula import DirectedRule
from train.certificates.bodies import Body
from train.certificates.plain import PlainStep
from train.certificates.scaling import SAME_AS_BASE
from train.certificates.step import rounding, step, trials
from train.certificates.subject import Certificate, Subject, worst
from train.refining import refine

# Child faces that the base makes flatter than this, in squared edge lengths, have no direction.
FLAT = 1e-9
# A budget that folds no face, on meshes whose reference length is about 1.
TOO_LITTLE = 1e-3
# In degrees: what positions rounded to doubles may turn a face by.
ROUNDING_ANGLE = 1e-5

SAME = 1e-12
SCALES = (2.0**-12, 2.0**-3, 2.0**5)


def fold_free(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify that no child face turns by more than θ from the base's with the same creases.

    The value is the largest turn in degrees, of a quad at any of its corners.
    """
    measured = [
        (largest_turn(base.triangles, base.positions, made), name)
        for name, base, made in _children(subject, bodies, seed)
    ]
    turn, place = worst(measured)
    return Certificate("folds", "fold-free", turn, high=_fold_angle(subject), where=place)


def neighbour_turns(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify that no two neighbouring child faces turn by more than 2 θ beyond the base's pair.

    The value is the largest excess in degrees. It follows from `fold_free` by the triangle
    inequality on the sphere of normals.
    """
    measured = [
        (largest_excess(base.triangles, neighbours(base.triangles), base.positions, made), name)
        for name, base, made in _children(subject, bodies, seed)
    ]
    excess, place = worst(measured)
    high = 2 * _fold_angle(subject)
    return Certificate("turns", "turns of neighbours", excess, high=high, where=place)


def _fold_angle(subject: Subject) -> float:
    """Return θ with what rounding adds, in degrees; NaN without a guard."""
    card = subject.learned_once
    angle = math.nan if card is None or card.fold_angle is None else card.fold_angle
    return angle + ROUNDING_ANGLE


def _children(
    subject: Subject, bodies: Sequence[Body], seed: int
) -> Iterator[tuple[str, PlainStep, Float[np.ndarray, "W 3"]]]:
    """Yield each trial's name, its step by the base scheme, and its new vertices by the subject."""
    for trial in trials(subject, bodies, seed):
        base = subject.base.plain(trial.mesh.vertices, trial.mesh.polygons, trial.creases)
        yield trial.name, base, step(subject.scheme, trial.mesh, trial.creases).positions


def neighbours(triangles: Int[np.ndarray, "F 3"]) -> Int[np.ndarray, "N 2"]:
    """Return the pairs of triangles that run through a side in opposite directions."""
    starts, ends = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    lower, upper = np.minimum(starts, ends), np.maximum(starts, ends)
    _, side = np.unique(lower * (upper.max() + 1) + upper, return_inverse=True)
    owner, along = np.arange(len(starts)) // 3, np.where(starts < ends, 1, -1)
    incidence = sparse.csr_array((along, (owner, side.reshape(-1))))
    shared = sparse.triu(incidence @ incidence.T).tocoo()
    return np.stack([shared.row, shared.col], axis=1)[shared.data < 0]


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
    """Certify that the report of two levels bounds the distance from the base's limit surface.

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
        theirs = refined(subject.base.scheme, 2, 1.0, limit=True, creases=Creases())
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
    """Certify that the rule becomes the base's: its limits are C² off extraordinary points.

    It does after the control mesh, or later where it keeps creases for longer. The value is the
    largest difference from an independent base at the level after, in the mesh's extents; NaN for a
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
        expected = subject.base.plain(last.vertices, last.polygons).positions
        extent = np.ptp(last.vertices, axis=0).max()
        measured.append((float(np.abs(after.vertices - expected).max() / extent), body.name))
    value, place = worst(measured)
    return Certificate("class", name, value, high=SAME, where=place)


def resolution_independence(subject: Subject, bodies: Sequence[Body]) -> Certificate:
    """Certify that what is learned is in units of h: without the budget, scaling a mesh scales δ.

    R stays what it is. A rule in units of h² / R fails: it is right at one resolution alone. The
    value is the largest relative difference.
    """
    measured = []
    for body in bodies:
        own = _displacement(subject, body.mesh)
        size = np.abs(own).max()
        if size == 0:
            continue
        for scale in SCALES:
            scaled = Mesh(scale * body.mesh.vertices, body.mesh.polygons)
            apart = _displacement(subject, scaled) / scale - own
            measured.append((float(np.abs(apart).max() / size), f"{body.name}, times {scale:g}"))
    value, place = worst(measured) if measured else (0.0, SAME_AS_BASE)
    return Certificate("scale", "resolution independence", value, high=SAME, where=place)


def _displacement(subject: Subject, mesh: Mesh) -> Float[np.ndarray, "N 3"]:
    assert subject.unbounded is not None
    return step(subject.unbounded, mesh).positions - step(subject.base.scheme, mesh).positions


def numbering(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify that other numbers of vertices, faces and first corners only number the result anew.

    The value is the largest difference in the mesh's largest coordinates, in double precision.
    """
    rng, measured = np.random.default_rng(seed), []
    for body in bodies:
        mesh = body.mesh
        order, turned = rng.permutation(len(mesh.vertices)), rng.permutation(mesh.face_count)
        points = np.empty_like(mesh.vertices)
        points[order] = mesh.vertices
        faces = [np.roll(order[face], rng.integers(len(face))) for face in mesh.polygons]
        other = Mesh(points, [faces[f] for f in turned])
        ours, theirs = (step(subject.exact, each, "auto").positions for each in (mesh, other))
        apart = np.abs(theirs[_places(mesh, other, order, turned)[: len(ours)]] - ours)
        measured.append((float(apart.max() / np.abs(mesh.vertices).max()), body.name))
    value, place = worst(measured)
    return Certificate("numbers", "numbering", value, high=SAME, where=place)


def _places(
    mesh: Mesh, other: Mesh, order: Int[np.ndarray, " V"], turned: Int[np.ndarray, " F"]
) -> Int[np.ndarray, " W"]:
    """Return where each new vertex of a mesh is in one with other numbers."""
    ours, theirs = mesh.topology().edges, other.topology().edges
    number = {frozenset(ends): e for e, ends in enumerate(theirs.tolist())}
    edges = [number[frozenset(ends)] for ends in order[ours.astype(np.int64)].tolist()]
    count = len(mesh.vertices)
    return np.concatenate([order, count + np.array(edges), count + len(edges) + np.argsort(turned)])


def locality(subject: Subject, bodies: Sequence[Body], seed: int = 0) -> Certificate:
    """Certify how far a vertex is seen: by two rings more than there are rounds of messages.

    States see one ring more; gates read the sharpness of the edges beside. The value is the largest
    distance, in rings of faces, from a moved vertex to the vertex, edge or face whose new vertex
    its move changed. The budget is small: the guard's halvings may pass from face to face.
    """
    rng, card, measured = np.random.default_rng(seed), subject.learned_once, []
    assert card is not None
    assert card.rounds is not None
    scheme = _without_guard(subject)
    for body in bodies:
        mesh, moved = body.mesh, body.mesh.vertices.copy()
        chosen = int(rng.integers(len(moved)))
        nearest = np.linalg.norm(np.delete(moved, chosen, axis=0) - moved[chosen], axis=1).min()
        moved[chosen] += 0.2 * nearest * rng.standard_normal(3)
        before, after = (
            step(scheme, each, "auto").positions for each in (mesh, Mesh(moved, mesh.polygons))
        )
        changed = (before != after).any(axis=1)
        rings = _rings_from(mesh, chosen)
        edges = rings[mesh.topology().edges.astype(np.int64)].min(axis=1)
        faces = np.minimum.reduceat(rings[mesh.corners], mesh.offsets[:-1])
        seen = np.concatenate([rings, edges, faces])[: len(before)]
        measured.append((float(seen[changed].max(initial=0)), f"{body.name}, vertex {chosen}"))
    value, place = worst(measured)
    return Certificate("rings", "locality", value, high=card.rounds + 2, where=place)


def _without_guard(subject: Subject) -> Scheme:
    """Return the scheme as it runs, with a budget too small to turn a face by its fold angle."""
    scheme = subject.scheme
    assert isinstance(scheme, Scheme)
    assert isinstance(scheme.rule, DirectedRule)
    return replace(scheme, rule=replace(scheme.rule, budget=TOO_LITTLE))


def _rings_from(mesh: Mesh, vertex: int) -> Int[np.ndarray, " V"]:
    """Return how many faces are on the way from a vertex to each; V where none leads there."""
    count, face = len(mesh.vertices), np.repeat(np.arange(mesh.face_count), np.diff(mesh.offsets))
    joins = sparse.csr_array((np.ones(len(face)), (mesh.corners, face)))
    rings = np.full(count, count)
    reached = np.zeros(count)
    reached[vertex] = 1
    for ring in range(count):
        new = (reached > 0) & (rings == count)
        if not new.any():
            break
        rings[new] = ring
        reached = joins @ (joins.T @ reached > 0).astype(float)
    return rings
