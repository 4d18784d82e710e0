"""Each certificate passes on a sound scheme, and fails by name on one that breaks its property."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pns_common import Mesh, MeshError, Scheme, load_model, loop, pns
from pns_common.model.file import model_from_bytes
from tests.support import schemes
from tests.support.control_points import refine
from tests.support.directed import directed_model, directed_model_bytes
from tests.support.meshes import bow_tie, bumpy_sphere, icosphere, one_way_pair, three_pages
from tests.support.networks import default_model, huge_model, random_model
from tests.support.shared import shared_path
from train.certificates.affine import affine_reproduction
from train.certificates.bodies import (
    Body,
    bumpy_torus,
    flat_bodies,
    real_bodies,
    synthetic_bodies,
)
from train.certificates.certify import run_steps, scheme_steps
from train.certificates.displacement import bounded_displacement
from train.certificates.double_precision import double_model
from train.certificates.equivariance import equivariance
from train.certificates.learned_once import (
    fold_free,
    limit_distance,
    locality,
    neighbour_turns,
    numbering,
    resolution_independence,
    smoothness_class,
)
from train.certificates.model_file import keeps_its_word
from train.certificates.plain import plain_loop
from train.certificates.planar_spectrum import lifted_stars, planar_spectrum
from train.certificates.scaling import (
    lipschitz_slope,
    normal_variation_slope,
    proximity_slope,
    regular_smoothness,
)
from train.certificates.subject import (
    Certificate,
    Subject,
    farthest,
    subject_of_model,
    subject_of_network,
    worst,
)
from train.experiments.harness.variants import VARIANTS, variant_recipe
from train.experiments.paper.structural import scaled, variant_subject
from train.models.from_recipe import initial_network
from train.models.networks import BoundedNet
from train.models.recipes import paper
from train.models.torch_model import recipe_model

BODIES, FLAT = synthetic_bodies(0), flat_bodies(0)[1:4]
ROUGH = (*BODIES, Body("rough", Mesh(*bumpy_sphere(0, bump=0.4))))

CLOSED = [body for body in ROUGH if not len(body.mesh.topology().sharp_edges)]

CERTIFICATES = {
    "T1": lambda subject: [bounded_displacement(subject, BODIES, levels=2)],
    "T2": lambda subject: equivariance(subject, BODIES, seed=0),
    "T3": lambda subject: affine_reproduction(subject, FLAT, seed=0),
    "T4": lambda subject: [proximity_slope(subject, BODIES)],
    "T5": lambda subject: [regular_smoothness(subject, bumpy_torus(0))],
    "T6": lambda subject: [normal_variation_slope(subject, BODIES)],
    "T7": lambda subject: [lipschitz_slope(subject, BODIES, seed=0)],
    "T8": lambda subject: planar_spectrum(subject, valences=(3, 7)),
}


def held(scheme):
    return Subject(scheme.name, scheme, scheme, schemes.BUDGET)


def random_network(seed, scale):
    network = BoundedNet(5, (32, 32), "gelu", torch.Generator().manual_seed(seed))
    with torch.no_grad():
        for weight in network.parameters():
            weight *= scale
    return recipe_model(paper(), network)


def lacking(name):
    """An operator without one part; its random weights are steep enough to use their freedom."""
    recipe = variant_recipe(paper(), VARIANTS[name])
    return variant_subject(name, scaled(initial_network(recipe), 5.0), recipe)


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


@pytest.mark.parametrize(
    ("theorem", "scheme", "name"),
    [
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
    ],
)
def test_a_broken_promise_fails_by_name(theorem, scheme, name):
    assert name in failed(CERTIFICATES[theorem](held(scheme)))


@pytest.mark.parametrize(
    ("variant", "lost", "kept"),
    [
        ("no-gate", "T3", "T1"),
        ("no-h2", "T4", "T3"),
        ("no-h2", "T6", "T3"),
        ("unbounded", "T1", "T2"),
        *(("unconstrained", theorem, None) for theorem in ("T1", "T2", "T3", "T4")),
    ],
)
def test_each_part_of_the_operator_protects_its_theorem(variant, lost, kept):
    subject = lacking(variant)
    assert failed(CERTIFICATES[lost](subject))
    assert kept is None or not failed(CERTIFICATES[kept](subject))


def test_a_frame_fixed_in_the_world_fails_through_a_model_too():
    """The row for single precision allows 1e-6 of the envelope, and no more."""
    model = random_model(0)
    subject = subject_of_model(model, model)
    assert failed(equivariance(subject, BODIES, 0)) <= {"equivariance, double precision"}
    broken = replace(subject, scheme=schemes.shifted(schemes.SOUND, edges=1e-6))
    assert "equivariance, as it runs" in failed(equivariance(broken, BODIES, 0))


def test_the_operator_holds_a_hostile_model_to_its_budget():
    model = huge_model(2)
    (certificate,) = CERTIFICATES["T1"](subject_of_model(model, model))
    assert certificate.passed
    assert certificate.value > 0.5


def test_lifted_stars_find_an_expanding_scheme():
    """A correction that grows steeply with the fold has an eigenvalue beyond 1 off the plane."""
    steep = schemes.along_normal(lambda h, x: h * torch.sin(200 * x))
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
    base, expected = plain_loop(mesh.vertices, mesh.faces), refine(mesh, loop(), 1)
    np.testing.assert_allclose(base.positions, expected.mesh.vertices, atol=1e-15)
    assert len(base.labels) == len(base.reach) == len(base.positions)


# The default's certificates: schemes that correct once, and are Loop afterwards.

ONCE = (
    *(fold_free, neighbour_turns, limit_distance),
    *(smoothness_class, resolution_independence),
)


def default_subject(scale=0.3, seed=0, **changes):
    model = default_model(seed, scale, **changes)
    return subject_of_model(model, model)


def with_rule(subject, **changes):
    """The subject with another rule than its card says."""
    scheme = subject.scheme
    assert isinstance(scheme, Scheme)
    made = replace(scheme, rule=replace(scheme.rule, **changes))
    return replace(subject, scheme=made, exact=made)


@pytest.mark.parametrize("certificate", ONCE)
@pytest.mark.parametrize("scale", [0.0, 0.3, 30.0])
def test_any_weights_pass_what_is_promised_of_correcting_once(certificate, scale):
    # Corners of borders stay for good: the class is that of closed bodies.
    bodies = CLOSED if certificate is smoothness_class else ROUGH
    result = certificate(default_subject(scale), bodies)
    assert result.passed, (result.value, result.where)


def test_a_guard_that_is_looser_than_it_says_is_found():
    wild = default_subject(30.0, network_scale=3.0)
    loose = with_rule(wild, fold_angle=89.0)
    assert fold_free(wild, ROUGH).passed
    assert not fold_free(loose, ROUGH).passed


def test_a_rule_beyond_its_budget_is_found():
    """At the size of a certificate's meshes it asks for less than the budget anyway."""
    sound = default_subject()
    assert bounded_displacement(sound, ROUGH, levels=1).passed
    assert not bounded_displacement(replace(sound, budget=sound.budget / 2), ROUGH, 1).passed
    curves = default_subject(0.0, budget=1e-3)
    honest = bounded_displacement(curves, CLOSED, 1)
    assert honest.passed
    assert honest.value > 0.999
    beyond = bounded_displacement(replace(curves, budget=curves.budget / 1.01), CLOSED, 1)
    assert not beyond.passed


def test_a_scheme_that_corrects_at_every_level_has_no_class():
    model = load_model("paper")
    every = subject_of_model(model, model)
    assert not smoothness_class(every, BODIES[:1]).passed
    assert [step.theorem for step in scheme_steps(every, (), 0, (3,))][-1] == "stars"
    once = [step.theorem for step in scheme_steps(default_subject(), (), 0, (3,))]
    assert once[-7:] == ["folds", "turns", "limit", "class", "scale", "numbers", "rings"]


def test_a_scheme_that_goes_on_past_its_level_is_found():
    sound = default_subject()
    lying = replace(sound, scheme=replace(sound.scheme, learned_levels=4))
    assert not smoothness_class(lying, BODIES[:1]).passed


def test_a_rule_in_squared_edge_lengths_depends_on_resolution():
    model = load_model("paper")
    result = resolution_independence(replace(default_subject(), unbounded=pns(model)), BODIES)
    assert not result.passed
    assert result.value > 0.5


def test_real_meshes_are_of_reference_length_one_and_pass(tmp_path):
    bodies = real_bodies(shared_path("assets"))
    for body in bodies:
        assert np.abs(body.mesh.vertices.mean(axis=0)).max() < 1e-12
        radius = np.linalg.norm(body.mesh.vertices, axis=1).max()
        assert radius / np.sqrt(2) == pytest.approx(1)
    real = [each for each in bodies if each.mesh.triangles and each.mesh.face_count < 1500]
    model = random_model(1, 3.0)
    subject = subject_of_model(model, model)
    assert not failed([bounded_displacement(subject, real, levels=1)])
    assert "equivariance, as it runs" not in failed(equivariance(subject, real, 0))
    with pytest.raises(MeshError, match=r"no \.obj"):
        real_bodies(tmp_path)


def test_nan_fails_and_is_the_worst_and_bounds_read_as_what_they_mean():
    assert not Certificate("T1", "x", float("nan")).passed
    assert worst([(1.0, "a"), (float("nan"), "b"), (2.0, "c")])[1] == "b"
    assert farthest([(1.0, "a"), (float("nan"), "b"), (9.0, "c")], 2.0)[1] == "b"
    for bound, low, high in (
        ("≤ 1 + 1e-12", -np.inf, 1 + 1e-12),
        ("= 0", 0, 0),
        ("1.999 … 2.001", 1.999, 2.001),
        ("≥ 0.5", 0.5, np.inf),
        ("any", -np.inf, np.inf),
    ):
        assert Certificate("T1", "x", 0, low, high).bound == bound


def directed_subject(base="loop"):
    data = directed_model_bytes(0, 0.3, base)
    model = model_from_bytes(data, "directed")
    return subject_of_model(model, double_model(model, data))


@pytest.mark.parametrize("base", ["loop", "catmull-clark"])
def test_any_weights_of_directed_edges_pass_every_certificate(base):
    subject = directed_subject(base)
    assert subject.is_single_precision
    made = run_steps(scheme_steps(subject, (), 0, (3,)), lambda *_: None)
    assert not failed(made), [(each.name, each.value, each.where) for each in made]
    once = {"folds", "turns", "limit", "class", "scale", "numbers", "rings"}
    assert {each.theorem for each in made} == once | {f"T{number}" for number in range(1, 9)}
    finite = keeps_its_word(directed_model(0, 0.3, base))
    assert not failed(finite)
    assert len(finite) == 7


def test_a_rule_that_reads_numbers_is_found():
    """The paper's reads the face of lower number first."""
    subject = subject_of_network(random_network(1, scale=5.0))
    assert failed([numbering(subject, BODIES)]) == {"numbering"}


def test_a_network_that_sees_farther_than_it_says_is_found():
    honest = directed_subject()
    near = replace(honest, card=replace(honest.card, rounds=1))
    assert failed([locality(near, BODIES)]) == {"locality"}


def test_a_double_precision_twin_that_is_single_is_found():
    honest = directed_subject()
    rows = equivariance(replace(honest, exact=honest.scheme), BODIES[:1], 0)
    assert "equivariance, mirrors" in failed(rows)
