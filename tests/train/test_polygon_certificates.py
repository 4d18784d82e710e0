"""Certificates over Catmull–Clark: they hold for any weights, and fail where they should."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, Scheme, catmull_clark, pns, refine
from pns_common.schemes import CATMULL_CLARK
from tests.support.networks import POLYGON_CARD, TiedPolygonModel
from tests.support.polygons import SHAPES, uneven
from train.certificates.certify import run_steps, scheme_steps
from train.certificates.plain_catmull_clark import plain_catmull_clark
from train.certificates.polygons import flat_star, polygon_bodies
from train.certificates.subject import Subject, subject_of_model

TIED = TiedPolygonModel(5)
VALENCES = (3, 5)


def certified(subject):
    steps = scheme_steps(subject, (), 0, VALENCES)
    return {c.name: c for c in run_steps(steps, lambda *_: None)}


def test_any_weights_with_the_symmetries_pass():
    failed = [c for c in certified(subject_of_model(TIED, TIED)).values() if not c.passed]
    assert failed == []


def test_another_base_scheme_fails_its_spectrum_and_its_bound():
    """Midpoints of edges and centres of faces, with old vertices where they are."""

    def flat(values, topology, blocks):
        placed = CATMULL_CLARK.place(values, topology, blocks)
        placed[: len(values)] = values
        return placed

    scheme = Scheme("flat", replace(CATMULL_CLARK, place=flat))
    made = certified(Subject("flat", scheme, scheme, 0.0, POLYGON_CARD, scheme))
    failed = {name for name, certificate in made.items() if not certificate.passed}
    assert {
        "bounded displacement",
        "planes",
        "planar spectrum: tangent eigenvalues against the published ones",
        "planar spectrum: derivative of the departure from Catmull–Clark",
        "smoothness class",
    } <= failed


def test_less_budget_than_is_used_and_missing_symmetries_fail():
    subject = subject_of_model(TIED, TIED)
    lopsided = TiedPolygonModel(5)
    # The identity alone is no group of an edge's symmetries.
    network, group = lopsided.networks["signed-18"]
    whole = {name: getattr(group, name)[:1] for name in ("order", "signs", "local")}
    lopsided.networks["signed-18"] = network, replace(group, **whole)
    assert not certified(replace(subject, budget=subject.budget / 2))["bounded displacement"].passed
    assert not certified(subject_of_model(lopsided, lopsided))["equivariance, mirrors"].passed


@pytest.mark.parametrize("name", SHAPES)
def test_the_oracle_of_certificates_is_catmull_clark(name):
    points, faces = SHAPES[name]
    points = uneven(points)
    base = plain_catmull_clark(points, [list(map(int, face)) for face in faces])
    expected = refine(Mesh(points, faces), catmull_clark(), 1).mesh.vertices
    np.testing.assert_allclose(base.positions, expected, rtol=0, atol=1e-14)


def test_bodies_have_faces_of_many_degrees_and_stars_the_valence_asked_for():
    degrees = {len(face) for body in polygon_bodies(0) for face in body.faces}
    assert {3, 4, 7} <= degrees
    for k in VALENCES:
        _, faces = flat_star(k)
        assert sum(0 in face for face in faces) == k
    assert pns(TIED).base is CATMULL_CLARK
