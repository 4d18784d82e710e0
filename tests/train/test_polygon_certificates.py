"""Certificates over Catmull–Clark: they hold for any weights, and fail where they should."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, Scheme, catmull_clark
from pns_common.schemes import CATMULL_CLARK
from tests.support.control_points import refine
from tests.support.directed import directed_model, directed_model_bytes
from tests.support.networks import default_model
from tests.support.polygons import SHAPES, uneven
from train.certificates.certify import run_steps, scheme_steps
from train.certificates.double_precision import double_model
from train.certificates.plain import plain_catmull_clark
from train.certificates.step import drawn_creases
from train.certificates.subject import Subject, subject_of_model

TIED = directed_model(5, 0.3, "catmull-clark")
POLYGON_CARD = TIED.card
TWIN = double_model(TIED, directed_model_bytes(5, 0.3, "catmull-clark"))
VALENCES = (3, 5)


def certified(subject, *theorems):
    steps = scheme_steps(subject, (), 0, VALENCES)
    chosen = [step for step in steps if not theorems or step.theorem in theorems]
    return {c.name: c for c in run_steps(chosen, lambda *_: None)}


def failed(subject, *theorems):
    made = certified(subject, *theorems).values()
    return {certificate.name for certificate in made if not certificate.passed}


def adding(amount):
    """Catmull–Clark, and ``amount(h, bend)`` along the normal of each face at its vertex.

    h is the face's longest side, and h times bend how high the vertices of its edges lie over it.
    """

    def place(points, topology, blocks):
        placed = CATMULL_CLARK.place(points, topology, blocks)
        starts, degrees = topology.offsets[:-1], np.diff(topology.offsets)
        corners, rims = points[topology.corners], topology.corner_edges + len(points)
        arms = corners - np.repeat(corners[starts], degrees, axis=0)
        following = np.roll(arms, -1, axis=0)  # of a face's last corner 0, as of its first
        normal = np.add.reduceat(np.cross(arms, following), starts)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        h = np.maximum.reduceat(np.linalg.norm(following - arms, axis=1), starts)
        above = np.add.reduceat(placed[rims] - corners, starts) / degrees[:, None]
        bend = np.sum(above * normal, axis=1) / h
        placed[-len(starts) :] += amount(h, bend)[:, None] * normal
        return placed

    scheme = Scheme("adding", replace(CATMULL_CLARK, place=place))
    return Subject("adding", scheme, scheme, 1.0, POLYGON_CARD, scheme)


def test_a_sound_rule_passes_what_broken_ones_fail():
    sound = adding(lambda h, bend: h**2 * np.tanh(bend) ** 3)
    assert not failed(sound, "T1", "T2", "T3", "T4", "T6", "T7", "T8")


@pytest.mark.parametrize(
    ("theorem", "amount", "name"),
    [
        ("T1", lambda h, bend: 1.1 * h**2, "bounded displacement"),
        ("T3", lambda h, bend: h**2, "affine reproduction, axis-aligned"),
        ("T4", lambda h, bend: h * np.tanh(bend), "proximity slope"),
        ("T5", lambda h, bend: h / 4, "normals settle in regular regions"),
        ("T6", lambda h, bend: h * np.tanh(bend), "normal-variation slope"),
        ("T7", lambda h, bend: h**2 * (np.floor(1e9 * h) % 2), "Lipschitz slope"),
        ("folds", lambda h, bend: 9 * h, "fold-free"),
        ("turns", lambda h, bend: 9 * h, "turns of neighbours"),
        ("limit", lambda h, bend: h / 9, "limit distance"),
        ("class", lambda h, bend: h**2, "smoothness class"),
        ("scale", lambda h, bend: h**2, "resolution independence"),
        (
            "T8",
            lambda h, bend: h * bend,
            "planar spectrum: derivative of the departure from Catmull–Clark",
        ),
    ],
)
def test_a_broken_promise_fails_by_name(theorem, amount, name):
    assert name in failed(adding(amount), theorem)


def test_a_push_fixed_in_the_world_is_not_equivariant():
    def place(points, topology, blocks):
        return np.add(CATMULL_CLARK.place(points, topology, blocks), [1e-5, 0, 0])

    scheme = Scheme("fixed", replace(CATMULL_CLARK, place=place))
    subject = Subject("fixed", scheme, replace(scheme), 1.0, POLYGON_CARD, scheme)
    kinds = "double precision", "as it runs", "mirrors"
    assert failed(subject, "T2") == {f"equivariance, {kind}" for kind in kinds}


def test_another_base_scheme_fails_its_spectrum_and_its_bound():
    """Midpoints of edges and centres of faces, with old vertices where they are."""

    def flat(values, topology, blocks):
        placed = CATMULL_CLARK.place(values, topology, blocks)
        placed[: len(values)] = values
        return placed

    scheme = Scheme("flat", replace(CATMULL_CLARK, place=flat))
    assert {
        "bounded displacement",
        "affine reproduction, axis-aligned",
        "planar spectrum: tangent eigenvalues against the published ones",
        "planar spectrum: Reif gap against Catmull–Clark's",
        "planar spectrum: derivative of the departure from Catmull–Clark",
        "smoothness class",
    } <= failed(
        Subject("flat", scheme, scheme, 0.0, POLYGON_CARD, scheme), "T1", "T3", "T8", "class"
    )


def test_less_budget_than_is_used_and_missing_symmetries_fail():
    subject, untied = subject_of_model(TIED, TWIN), default_model(base="catmull-clark")
    assert failed(replace(subject, budget=subject.budget / 9), "T1") == {"bounded displacement"}
    assert "equivariance, mirrors" in failed(subject_of_model(untied, untied), "T2")


@pytest.mark.parametrize("creased", [False, True], ids=["smooth", "creased"])
@pytest.mark.parametrize("name", SHAPES)
def test_the_oracle_of_certificates_is_catmull_clark(name, creased):
    mesh = Mesh(uneven(SHAPES[name][0]), SHAPES[name][1])
    creases = drawn_creases(mesh, np.random.default_rng(0))[: None if creased else 0]
    base = plain_catmull_clark(mesh.vertices, mesh.polygons, creases)
    made = refine(mesh, catmull_clark(), 1, creases=creases)
    np.testing.assert_allclose(base.positions, made.mesh.vertices, rtol=0, atol=1e-14)
    quads = made.mesh.faces
    corners = [np.roll(quads, 1 - c, axis=1)[:, :3] for c in range(4)]
    assert {*map(tuple, np.concatenate(corners).tolist())} == {*map(tuple, base.triangles.tolist())}
    assert len(base.labels) == len(base.reach) == len(base.curve_reach) == len(base.positions)
