"""Each certificate passes on a sound scheme, and fails by name on one that breaks its property."""

import numpy as np
import pytest
import torch

from pns_common import Mesh, MeshError, loop, pns, refine
from pns_common.schemes import Placement, Scheme, loop_edge_rule, loop_vertex_rule
from tests.support import schemes
from tests.support.meshes import bow_tie, icosphere, one_way_pair, three_pages
from tests.support.networks import huge_model, random_model
from tests.support.shared import shared_path
from train.certificates.affine import affine_reproduction
from train.certificates.bodies import (
    Body,
    bumpy_torus,
    flat_bodies,
    real_bodies,
    synthetic_bodies,
)
from train.certificates.certificate import Certificate, farthest, worst
from train.certificates.displacement import bounded_displacement
from train.certificates.equivariance import equivariance
from train.certificates.lifted_star import lifted_stars
from train.certificates.plain_loop import plain_loop
from train.certificates.planar_spectrum import planar_spectrum
from train.certificates.regular import regular_smoothness
from train.certificates.scaling import normal_variation_slope, proximity_slope
from train.certificates.stability import lipschitz_slope
from train.certificates.subject import Subject, subject_of_model, subject_of_network
from train.certificates.trials import drawn_creases
from train.models.networks import BoundedNet
from train.models.recipes import paper
from train.models.torch_model import recipe_model

BODIES, FLAT = synthetic_bodies(0), flat_bodies(0)[1:4]

CERTIFICATES = {
    "T1": lambda subject: [bounded_displacement(subject, BODIES, levels=2)],
    "T2": lambda subject: equivariance(subject, BODIES, seed=0),
    "T3": lambda subject: affine_reproduction(subject, FLAT, seed=0),
    "T4": lambda subject: [proximity_slope(subject, BODIES)],
    "T5": lambda subject: [regular_smoothness(subject, seed=0)],
    "T6": lambda subject: [normal_variation_slope(subject, BODIES)],
    "T7": lambda subject: [lipschitz_slope(subject, BODIES, seed=0)],
    "T8": lambda subject: planar_spectrum(subject, valences=(3, 6, 7)),
}


def held(scheme):
    return Subject(scheme.name, scheme, scheme, schemes.BUDGET)


def random_network(seed, scale):
    generator = torch.Generator().manual_seed(seed)
    network = BoundedNet(5, (32, 32), "gelu", generator)
    with torch.no_grad():
        for weight in network.parameters():
            weight *= scale
    return recipe_model(paper(), network)


def failed(certificates):
    return {certificate.name for certificate in certificates if not certificate.passed}


@pytest.mark.parametrize("theorem", CERTIFICATES)
@pytest.mark.parametrize("scheme", [loop(), schemes.SOUND], ids=["loop", "sound"])
def test_sound_schemes_pass(theorem, scheme):
    assert not failed(CERTIFICATES[theorem](held(scheme)))


@pytest.mark.parametrize("theorem", CERTIFICATES)
def test_random_weights_pass_as_they_run_and_in_double_precision(theorem):
    subject = subject_of_network(random_network(1, scale=5.0))
    assert subject.is_single_precision
    assert not failed(CERTIFICATES[theorem](subject))


BREAKS = [
    ("T1", schemes.TOO_FAR, "bounded displacement"),
    ("T1", schemes.shifted(schemes.SOUND, edges=1e-3), "bounded displacement"),
    ("T1", schemes.shifted(schemes.SOUND, vertices=1e-12), "bounded displacement"),
    ("T2", schemes.shifted(schemes.SOUND, edges=1e-11), "equivariance, double precision"),
    ("T3", schemes.NO_GATE, "affine reproduction, axis-aligned"),
    ("T3", schemes.NO_GATE, "affine reproduction, any plane"),
    ("T3", schemes.GATE_OF_ORDER_ONE, "affine reproduction, any plane"),
    ("T3", schemes.shifted(schemes.SOUND, edges=1e-12), "affine reproduction, axis-aligned"),
    ("T3", schemes.shifted(schemes.SOUND, edges=1e-12), "affine reproduction, any plane"),
    ("T4", schemes.ONE_POWER_OF_H, "proximity slope"),
    ("T4", schemes.shifted(schemes.SOUND, edges=1e-3), "proximity slope"),
    ("T5", schemes.NO_GATE_ONE_POWER, "normals settle in regular regions"),
    ("T6", schemes.ONE_POWER_OF_H, "normal-variation slope"),
    ("T7", schemes.JUMPING, "Lipschitz slope"),
    ("T8", schemes.GATE_WITH_A_KINK, "planar spectrum: derivative of the departure from Loop"),
]


@pytest.mark.parametrize(("theorem", "scheme", "name"), BREAKS)
def test_a_broken_promise_fails_by_name(theorem, scheme, name):
    assert name in failed(CERTIFICATES[theorem](held(scheme)))


def test_a_gate_of_order_one_keeps_the_planar_spectrum():
    """x is of second order in a lift, so this scheme's linearisation is Loop's all the same."""
    assert not failed(CERTIFICATES["T8"](held(schemes.GATE_OF_ORDER_ONE)))


@pytest.mark.parametrize(("endpoint", "what"), [(0.38, "tangent eigenvalues"), (0.36, "Reif gap")])
def test_other_masks_have_another_planar_spectrum(endpoint, what):
    def edge_rule(level):
        base, inner = loop_edge_rule(level), level.topology.interior
        a, b, c, d = (level.points[level.topology.stencil[inner, i]] for i in range(4))
        positions = base.loop.copy()
        positions[inner] = endpoint * (a + b) + (0.5 - endpoint) * (c + d)
        return Placement(positions, None, base.ratio, base.gate, base.degenerate)

    certificates = CERTIFICATES["T8"](held(Scheme("masks", loop_vertex_rule, edge_rule)))
    assert any(what in name for name in failed(certificates))
    assert any("derivative" in name for name in failed(certificates))


def test_a_frame_fixed_in_the_world_fails_through_a_model_too():
    """The row for single precision allows 1e-6 of the envelope, and no more."""
    subject = subject_of_model(random_model(0), random_model(0))
    edges = pns(random_model(0)).edge_rule

    def edge_rule(level):
        placement = edges(level)
        up = np.linalg.norm(placement.displacement, axis=1, keepdims=True) * np.array([0, 0, 1e-3])
        return Placement(
            placement.loop + up, None, placement.ratio, placement.gate, placement.degenerate
        )

    world = Scheme("world", loop_vertex_rule, edge_rule)
    broken = type(subject)("world", world, subject.exact, subject.budget)
    assert failed(equivariance(subject, BODIES, 0)) <= {"equivariance, double precision"}
    assert "equivariance, as it runs" in failed(equivariance(broken, BODIES, 0))


def test_the_operator_holds_a_hostile_model_to_its_budget():
    model = huge_model(2)
    (certificate,) = CERTIFICATES["T1"](subject_of_model(model, model))
    assert certificate.passed
    assert certificate.value > 0.5


def test_a_slope_is_named_even_where_the_scheme_is_loop():
    (certificate,) = CERTIFICATES["T4"](held(loop()))
    assert certificate.passed
    assert certificate.where == "the scheme is Loop on every mesh"


def test_budget_zero_is_loop():
    subject = subject_of_network(random_network(0, 1.0), budget=0.0)
    assert not failed(CERTIFICATES["T1"](subject) + CERTIFICATES["T4"](subject))


def test_lifted_stars_find_an_expanding_scheme():
    """A correction that grows steeply with the fold has an eigenvalue beyond 1 off the plane."""
    steep = schemes.along_normal(lambda h, x: h * np.sin(200 * x))
    _, largest = lifted_stars(held(steep), valences=(5,))
    assert largest.value > 1
    assert not largest.passed
    assert not largest.counts
    margin, largest = lifted_stars(held(loop()), valences=(5,))
    assert largest.passed
    assert margin.value == pytest.approx(0.2477203, abs=1e-6)


@pytest.mark.parametrize(
    "mesh", [icosphere(1), bow_tie(), three_pages(), one_way_pair()], ids=lambda _: ""
)
def test_plain_loop_agrees_with_the_operators_on_every_kind_of_edge(mesh):
    mesh = Mesh(*mesh)
    base = plain_loop(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(base.positions, refine(mesh, loop(), 1).mesh.vertices, atol=1e-15)
    assert len(base.labels) == len(base.reach) == len(base.positions)


@pytest.mark.parametrize(
    "body", [*BODIES, Body("closed", Mesh(*icosphere(1)))], ids=lambda b: b.name
)
def test_plain_loop_keeps_the_creases_that_the_operator_keeps(body):
    mesh, creases = body.mesh, drawn_creases(body.mesh, np.random.default_rng(0))
    base = plain_loop(mesh.vertices, mesh.faces, creases)
    kept = refine(mesh, loop(), 1, creases=creases)
    np.testing.assert_allclose(base.positions, kept.mesh.vertices, atol=1e-15)
    inside, rims = (kept.report["levels"][0]["edges"][kind] for kind in ("crease", "boundary"))
    assert inside > 0
    assert np.count_nonzero(base.curve_reach[len(mesh.vertices) :]) == inside + rims


def test_flat_bodies_are_flat_and_not_folded():
    for body in FLAT:
        corners = body.mesh.vertices[body.mesh.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (body.mesh.vertices[:, 2] == 0).all()
        assert (normal[:, 2] > 0).all() or (normal[:, 2] < 0).all()


def test_every_vertex_of_the_torus_is_regular():
    mesh = bumpy_torus(0)
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 2).all()
    assert (np.bincount(unique.reshape(-1)) == 6).all()


def test_real_meshes_are_centred_and_of_reference_length_one():
    for body in real_bodies(shared_path("assets")):
        assert np.abs(body.mesh.vertices.mean(axis=0)).max() < 1e-12
        radius = np.linalg.norm(body.mesh.vertices, axis=1).max()
        assert radius / np.sqrt(2) == pytest.approx(1)


def test_real_meshes_pass():
    real = [body for body in real_bodies(shared_path("assets")) if len(body.mesh.faces) < 1500]
    subject = subject_of_model(random_model(1, 3.0), random_model(1, 3.0))
    assert not failed([bounded_displacement(subject, real, levels=1)])
    assert "equivariance, as it runs" not in failed(equivariance(subject, real, 0))


def test_a_folder_without_meshes_is_refused(tmp_path):
    with pytest.raises(MeshError, match=r"no \.obj"):
        real_bodies(tmp_path)


def test_nan_fails_and_is_the_worst():
    assert not Certificate("T1", "x", float("nan")).passed
    assert worst([(1.0, "a"), (float("nan"), "b"), (2.0, "c")])[1] == "b"
    assert farthest([(1.0, "a"), (float("nan"), "b"), (9.0, "c")], 2.0)[1] == "b"


def test_bounds_read_as_what_they_mean():
    assert Certificate("T1", "x", 0, high=1 + 1e-12).bound == "≤ 1"
    assert Certificate("T3", "x", 0, 0, 0).bound == "= 0"
    assert Certificate("T4", "x", 2, 1.999, 2.001).bound == "1.999 … 2.001"
    assert Certificate("T5", "x", 1, low=0.5).bound == "≥ 0.5"
    assert Certificate("stars", "x", -1).bound == "any"


def test_names_of_bodies():
    assert [body.name for body in BODIES] == ["paraboloid", "bumpy sphere", "ridge"]
    assert isinstance(BODIES[0], Body)
