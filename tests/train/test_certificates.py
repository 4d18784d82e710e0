"""Each certificate passes on a sound scheme, and fails by name on one that breaks its property."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pns_common import Mesh, MeshError, Scheme, catmull_clark, load_model, loop, pns
from pns_common.model.file import model_from_bytes
from pns_common.schemes import CATMULL_CLARK
from tests.support import schemes
from tests.support.control_points import refine
from tests.support.directed import directed_model, directed_model_bytes
from tests.support.meshes import bow_tie, bumpy_sphere, icosphere, one_way_pair, three_pages
from tests.support.networks import default_model, huge_model, random_model
from tests.support.polygons import SHAPES, uneven
from tests.support.shared import shared_path
from train.certificates.affine import affine_reproduction
from train.certificates.bodies import Body, bumpy_torus, flat_bodies, real_bodies, synthetic_bodies
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
from train.certificates.plain import plain_catmull_clark, plain_loop
from train.certificates.planar_spectrum import lifted_stars, planar_spectrum
from train.certificates.scaling import (
    lipschitz_slope,
    normal_variation_slope,
    proximity_slope,
    regular_smoothness,
)
from train.certificates.step import drawn_creases
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
ONCE = "folds", "turns", "limit", "class", "scale", "numbers", "rings"


def held(scheme):
    return Subject(scheme.name, scheme, scheme, schemes.BUDGET)


def lacking(name):
    """An operator without one part; its random weights are steep enough to use their freedom."""
    recipe = variant_recipe(paper(), VARIANTS[name])
    return variant_subject(name, scaled(initial_network(recipe), 5.0), recipe)


def failed(certificates):
    return {certificate.name for certificate in certificates if not certificate.passed}


def run_all(subject, *theorems, valences=(3,)):
    steps = scheme_steps(subject, (), 0, valences)
    chosen = [step for step in steps if not theorems or step.theorem in theorems]
    return run_steps(chosen, lambda *_: None)


@pytest.mark.parametrize("theorem", CERTIFICATES)
def test_sound_schemes_and_random_weights_pass(theorem):
    weights = scaled(initial_network(paper(1)), 5.0)
    network = subject_of_network(recipe_model(paper(), weights))
    assert network.is_single_precision
    for subject in (held(loop()), held(schemes.SOUND), network):
        assert not failed(CERTIFICATES[theorem](subject))


@pytest.mark.parametrize(
    ("theorem", "scheme", "name"),
    [
        ("T1", schemes.TOO_FAR, "bounded displacement"),
        ("T1", schemes.shifted(schemes.SOUND, edges=1e-3), "bounded displacement"),
        ("T1", schemes.shifted(schemes.SOUND, vertices=1e-12), "bounded displacement"),
        ("T2", schemes.shifted(schemes.SOUND, edges=1e-11), "equivariance, double precision"),
        ("T3", schemes.NO_GATE, "affine reproduction, axis-aligned"),
        ("T3", schemes.GATE_OF_ORDER_ONE, "affine reproduction, any plane"),
        ("T3", schemes.shifted(schemes.SOUND, edges=1e-12), "affine reproduction, axis-aligned"),
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


def test_the_operator_holds_a_hostile_model_to_its_budget():
    model = huge_model(2)
    (certificate,) = CERTIFICATES["T1"](subject_of_model(model, model))
    assert certificate.passed
    assert certificate.value > 0.5


def test_single_precision_has_a_row_of_its_own_that_allows_no_more_than_its_rounding():
    model = random_model(0)
    subject = subject_of_model(model, model)
    assert failed(equivariance(subject, BODIES, 0)) <= {"equivariance, double precision"}
    broken = replace(subject, scheme=schemes.shifted(schemes.SOUND, edges=1e-6))
    assert "equivariance, as it runs" in failed(equivariance(broken, BODIES, 0))
    honest = directed_subject()
    rows = equivariance(replace(honest, exact=honest.scheme), BODIES[:1], 0)
    assert "equivariance, mirrors" in failed(rows)


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
def test_the_oracle_of_certificates_is_loop_on_every_kind_of_edge(mesh):
    mesh = Mesh(*mesh)
    base, expected = plain_loop(mesh.vertices, mesh.faces), refine(mesh, loop(), 1)
    np.testing.assert_allclose(base.positions, expected.mesh.vertices, atol=1e-15)
    assert len(base.labels) == len(base.reach) == len(base.positions)


@pytest.mark.parametrize("creased", [False, True], ids=["smooth", "creased"])
@pytest.mark.parametrize("name", SHAPES)
def test_the_oracle_of_certificates_is_catmull_clark(name, creased):
    mesh = Mesh(uneven(SHAPES[name][0]), SHAPES[name][1])
    creases = drawn_creases(mesh, np.random.default_rng(0))[: None if creased else 0]
    base = plain_catmull_clark(mesh.vertices, mesh.polygons, creases)
    made = refine(mesh, catmull_clark(), 1, creases=creases)
    np.testing.assert_allclose(base.positions, made.mesh.vertices, rtol=0, atol=1e-14)
    corners = [np.roll(made.mesh.faces, 1 - c, axis=1)[:, :3] for c in range(4)]
    assert {*map(tuple, np.concatenate(corners).tolist())} == {*map(tuple, base.triangles.tolist())}
    assert len(base.labels) == len(base.reach) == len(base.curve_reach) == len(base.positions)


# Schemes that correct once, and are their base afterwards.


def default_subject(scale=0.3, seed=0, **changes):
    model = default_model(seed, scale, **changes)
    return subject_of_model(model, model)


def directed_subject(base="loop"):
    data = directed_model_bytes(0, 0.3, base)
    model = model_from_bytes(data, "directed")
    return subject_of_model(model, double_model(model, data))


@pytest.mark.parametrize("base", ["loop", "catmull-clark"])
def test_any_weights_of_directed_edges_pass_every_certificate(base):
    subject = directed_subject(base)
    made = run_all(subject)
    assert not failed(made), [(each.name, each.value, each.where) for each in made]
    assert {each.theorem for each in made} == {*ONCE, *CERTIFICATES}
    finite = keeps_its_word(directed_model(0, 0.3, base))
    assert not failed(finite)
    assert len(finite) == 7


@pytest.mark.parametrize("scale", [0.0, 30.0])
def test_silent_and_loud_weights_pass_what_is_promised_of_correcting_once(scale):
    subject = default_subject(scale)
    # Corners of borders stay for good: the class is that of closed bodies.
    made = [smoothness_class(subject, CLOSED), resolution_independence(subject, ROUGH)]
    made += [each(subject, ROUGH) for each in (fold_free, neighbour_turns, limit_distance)]
    assert not failed(made), [(each.name, each.value, each.where) for each in made]


def test_a_guard_that_is_looser_than_it_says_is_found():
    wild = default_subject(30.0, network_scale=3.0)
    loose = replace(wild.scheme, rule=replace(wild.scheme.rule, fold_angle=89.0))
    assert fold_free(wild, ROUGH).passed
    assert not fold_free(replace(wild, scheme=loose), ROUGH).passed


def test_a_rule_beyond_its_budget_is_found():
    """Also that of curves alone, which uses its own up."""
    sound, curves = default_subject(), default_subject(0.0, budget=1e-3)
    assert bounded_displacement(sound, ROUGH, levels=1).passed
    assert not bounded_displacement(replace(sound, budget=sound.budget / 2), ROUGH, 1).passed
    honest = bounded_displacement(curves, CLOSED, 1)
    assert honest.passed
    assert honest.value > 0.999
    beyond = replace(curves, budget=curves.budget / 1.01)
    assert not bounded_displacement(beyond, CLOSED, 1).passed


def test_a_scheme_that_corrects_for_longer_than_it_says_is_found():
    model, sound = load_model("paper"), default_subject()
    every = subject_of_model(model, model)
    assert not smoothness_class(every, BODIES[:1]).passed
    assert [step.theorem for step in scheme_steps(every, (), 0, (3,))][-1] == "stars"
    assert tuple(step.theorem for step in scheme_steps(sound, (), 0, (3,)))[-7:] == ONCE
    lying = replace(sound, scheme=replace(sound.scheme, learned_levels=4))
    assert not smoothness_class(lying, BODIES[:1]).passed


def test_rules_that_read_sizes_numbers_or_farther_vertices_are_found():
    papers = load_model("paper")
    sized = resolution_independence(replace(default_subject(), unbounded=pns(papers)), BODIES)
    assert not sized.passed
    assert sized.value > 0.5
    # The paper's rule reads the face of lower number first.
    assert failed([numbering(subject_of_model(papers, papers), BODIES)]) == {"numbering"}
    honest = directed_subject()
    near = replace(honest, card=replace(honest.card, rounds=1))
    assert failed([locality(near, BODIES)]) == {"locality"}


# Over Catmull–Clark.

TIED = directed_model(5, 0.3, "catmull-clark")


def placing(name, place, budget=1.0):
    scheme = Scheme(name, replace(CATMULL_CLARK, place=place))
    return Subject(name, scheme, scheme, budget, TIED.card, scheme)


def adding(amount):
    """Catmull–Clark, and ``amount(h)`` along the normal of each face of longest side h."""

    def place(points, topology, blocks):
        placed = CATMULL_CLARK.place(points, topology, blocks)
        starts, degrees = topology.offsets[:-1], np.diff(topology.offsets)
        corners = points[topology.corners]
        arms = corners - np.repeat(corners[starts], degrees, axis=0)
        following = np.roll(arms, -1, axis=0)  # of a face's last corner 0, as of its first
        normal = np.add.reduceat(np.cross(arms, following), starts)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        h = np.maximum.reduceat(np.linalg.norm(following - arms, axis=1), starts)
        placed[-len(starts) :] += amount(h)[:, None] * normal
        return placed

    return placing("adding", place)


@pytest.mark.parametrize(
    ("theorem", "amount", "name"),
    [
        ("T1", lambda h: 1.1 * h**2, "bounded displacement"),
        ("T3", lambda h: h**2, "affine reproduction, axis-aligned"),
        ("T5", lambda h: h / 4, "normals settle in regular regions"),
        ("folds", lambda h: 9 * h, "fold-free"),
        ("turns", lambda h: 9 * h, "turns of neighbours"),
        ("limit", lambda h: h / 9, "limit distance"),
        ("class", lambda h: h**2, "smoothness class"),
        ("scale", lambda h: h**2, "resolution independence"),
    ],
)
def test_a_broken_promise_over_catmull_clark_fails_by_name(theorem, amount, name):
    assert name in failed(run_all(adding(amount), theorem))


def test_another_base_scheme_fails_its_spectrum_and_its_bound():
    """Midpoints of edges and centres of faces, with old vertices where they are."""

    def flat(values, topology, blocks):
        placed = CATMULL_CLARK.place(values, topology, blocks)
        placed[: len(values)] = values
        return placed

    assert {
        "bounded displacement",
        "affine reproduction, axis-aligned",
        "planar spectrum: tangent eigenvalues against the published ones",
        "planar spectrum: Reif gap against Catmull–Clark's",
        "planar spectrum: derivative of the departure from Catmull–Clark",
        "smoothness class",
    } <= failed(run_all(placing("flat", flat, 0.0), "T1", "T3", "T8", "class", valences=(3, 5)))


# Meshes that are given, and words.


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
