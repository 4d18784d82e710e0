"""Learned sharpness: features that know no direction, numbering or side, and weights in bounds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ModelError, loop, pns, sharp_edges
from pns_common.mesh.topology import build_topology
from pns_common.model.features import SIGNED_18
from pns_common.operator import sharpness
from pns_common.operator.formula import Rule
from pns_common.operator.level import Level
from pns_common.operator.sharpness import creases_by_name, learned_sharpness, sharpness_inputs
from pns_common.parallel import Blocks
from pns_common.schemes import CATMULL_CLARK, LOOP
from tests.support.control_points import refine
from tests.support.meshes import (
    block,
    bumpy_sphere,
    every_edge_class,
    manifolds,
    prism,
    rotation,
    soups,
    tilted_plane,
)
from tests.support.networks import DEFAULT_CARD, sharpening_model
from tests.support.polygons import cylinder
from tests.support.renumbering import mirrored, renumbered, turned_over
from tests.support.stand_in_models import ZeroModel

C_V = 100.0
seeds = st.integers(0, 2**31)


def level_of(mesh, threads=1):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    return Level(mesh.vertices, topology, LOOP, None, Blocks(threads))


def rule_with(network):
    return Rule(
        *(lambda phi: phi[:, :3], SIGNED_18, True, 1.0, 1.0),
        vertex_gate_sharpness=C_V,
        sharpness_network=network,
    )


def features_of(mesh, place=None):
    """ψ and its gate by edge of the mesh; ``place`` tells a twin's edges in our order."""
    level = level_of(mesh)
    rows, features, gate = sharpness_inputs(level, C_V)
    made = np.full((len(level.topology.edges), features.shape[1] + 1), np.nan)
    made[rows] = np.concatenate([features, gate[:, None]], axis=1)
    return made if place is None else made[place[len(mesh.vertices) :] - len(mesh.vertices)]


@given(manifolds(), seeds)
def test_features_are_those_of_the_same_mesh_seen_otherwise(mesh, seed):
    rng = np.random.default_rng(seed)
    expected = features_of(mesh)
    moved = mesh.vertices @ rotation(rng).T * 10.0 ** rng.integers(-4, 4) + rng.standard_normal(3)
    np.testing.assert_allclose(features_of(Mesh(moved, mesh.faces)), expected, atol=1e-9)
    for twin in (renumbered(mesh, seed), mirrored(mesh), turned_over(mesh)):
        np.testing.assert_allclose(features_of(twin.mesh, twin.place), expected, atol=1e-12)


@given(soups() | manifolds())
def test_features_are_finite_and_bounded(mesh):
    _, features, gate = sharpness_inputs(level_of(mesh), C_V)
    assert np.isfinite(features).all()
    assert np.abs(features).max(initial=0) <= 4
    assert ((gate >= 0) & (gate <= 1)).all()


def test_wing_edges_in_an_n_gon_are_those_of_its_fan():
    """A cap is as plane as the same cap cut into triangles around its middle."""
    points, faces = cylinder(9)
    middles = [len(points), len(points) + 1]
    cut = np.concatenate([points, points.reshape(2, 9, 3).mean(axis=1)])
    spokes = [
        [a, b, middle]
        for cap, middle in zip(faces[:2], middles, strict=True)
        for a, b in zip(cap, cap[1:] + cap[:1], strict=True)
    ]
    found = {}
    for name, mesh in (("n-gons", Mesh(points, faces)), ("fans", Mesh(cut, spokes + faces[2:]))):
        level = Level(mesh.vertices, mesh.topology(), CATMULL_CLARK, None, Blocks())
        rows, features, _ = sharpness_inputs(level, C_V)
        ends = np.sort(level.topology.edges[rows].astype(int), axis=1)
        rim = np.flatnonzero((ends // 9 == ends[:, :1] // 9).all(axis=1) & (ends < 18).all(axis=1))
        found[name] = features[rim[np.lexsort(ends[rim].T)]]
    assert len(found["n-gons"]) == 18
    wings, both = [2, 3, 4, 5, 6], [8, 9]
    np.testing.assert_allclose(
        found["n-gons"][:, wings + both], found["fans"][:, wings + both], atol=1e-12
    )


def test_features_of_a_box():
    """A right angle beside two planes, and what goes on at its ends."""
    points, faces = block(3)
    level = level_of(Mesh(points, faces))
    rows, features, _ = sharpness_inputs(level, C_V)
    ends = points[level.topology.edges[rows].astype(int)]
    on_edge = (np.abs(np.abs(ends) - 1) < 1e-9).all(axis=1).sum(axis=1) == 2
    at_corner = on_edge & (np.abs(np.abs(ends) - 1) < 1e-9).all(axis=2).any(axis=1)
    inside = on_edge & ~at_corner
    turn = np.sin(np.pi / 4)
    assert on_edge.sum() == 36
    assert at_corner.sum() == 24
    np.testing.assert_allclose(features[on_edge][:, 0], turn)
    np.testing.assert_allclose(features[on_edge][:, 1], 1)
    np.testing.assert_allclose(features[~on_edge][:, :2], 0, atol=1e-12)
    columns = {name: 2 * k for k, name in enumerate(ENDS)}
    for name, middle, corner in (
        ("straightest", (1, 1), (0, 1)),
        ("ridge", (turn, turn), (0, turn)),
        ("branch", (0, 0), (0, turn)),
        ("straightness of the sharpest", (1, 1), (0, 1)),
        ("largest alike", (turn, turn), (turn, turn)),
        ("second largest", (0, 0), (0, turn)),
        ("beyond 50", (1 / 4, 1 / 4), (1 / 4, 1 / 2)),
    ):
        at = FIRST_END + columns[name]
        found = features[:, [at, at + 1]]
        np.testing.assert_allclose(found[inside], np.tile(middle, (12, 1)), atol=1e-12)
        np.testing.assert_allclose(found[at_corner], np.tile(corner, (24, 1)), atol=1e-12)
    # 36 of 162 edges turn.
    np.testing.assert_allclose(features[:, -4:], 36 / 162)


FIRST_END = 16
ENDS = (
    *("beyond 15", "beyond 30", "beyond 50", "beyond 66", "mean turn", "valence", "length"),
    *("largest alike", "largest unlike", "second largest", "straightest", "ridge", "way out"),
    *("branch", "turn of the straightest", "straightness of the sharpest"),
)


@given(manifolds(), seeds)
def test_features_are_continuous(mesh, seed):
    """A small step changes little, also where edges change places; the own turn has a sign."""
    level = level_of(mesh)
    rows, features, _ = sharpness_inputs(level, C_V)
    step = 1e-9 * rng_vectors(seed, mesh)
    moved = Level(mesh.vertices + step, level.topology, LOOP, None, Blocks())
    _, others, _ = sharpness_inputs(moved, C_V)
    signed = features[:, 0] > 1e-4
    assert rows.shape == signed.shape
    np.testing.assert_allclose(others[signed], features[signed], atol=1e-4)


def rng_vectors(seed, mesh):
    return np.random.default_rng(seed).uniform(-1, 1, mesh.vertices.shape)


def random_network(seed, columns=sharpness.CREASE_53):
    weights = np.random.default_rng(seed).standard_normal((columns, 1))
    return lambda features: features @ weights


@pytest.mark.parametrize("name", every_edge_class())
def test_sharpness_is_within_its_gate_and_0_at_open_edges(name):
    level = level_of(Mesh(*every_edge_class()[name]))
    w = learned_sharpness(level, rule_with(random_network(0)))
    interior = np.zeros(len(w), dtype=bool)
    interior[level.topology.interior] = True
    rows, _, gate = sharpness_inputs(level, C_V)
    assert (w[~interior] == 0).all()
    assert (w[rows] <= gate).all()
    assert (w >= 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_planes_have_no_sharpness(seed):
    w = learned_sharpness(level_of(tilted_plane(seed)), rule_with(lambda psi: psi[:, :1] + 9))
    assert w.max() <= 1e-25


def test_marks_do_not_change_what_is_learned():
    level = level_of(Mesh(*bumpy_sphere()))
    marked = level.topology.with_creases(np.arange(0, 60, 3))
    rule = rule_with(random_network(1))
    same = learned_sharpness(Level(level.points, marked, LOOP, None, Blocks()), rule)
    np.testing.assert_array_equal(same, learned_sharpness(level, rule))


def test_sharpness_does_not_depend_on_threads():
    mesh = Mesh(*bumpy_sphere(subdivisions=5))
    rule = rule_with(random_network(2))
    one, three = (learned_sharpness(level_of(mesh, threads), rule) for threads in (1, 3))
    np.testing.assert_array_equal(one, three)
    assert len(np.unique(one)) > 100


def test_hubs_cost_no_square_of_their_valence():
    turns = np.linspace(0, 2 * np.pi, 20_001)[:-1]
    mesh = prism(np.stack([np.cos(turns), np.sin(turns)], axis=1))
    _, features, _ = sharpness_inputs(level_of(mesh), C_V)  # hours otherwise
    assert np.isfinite(features).all()


@pytest.mark.parametrize(
    "network",
    [
        lambda psi: np.full((len(psi), 1), np.nan),
        lambda psi: np.zeros((len(psi), 3)),
        lambda psi: np.full((len(psi), 1), "sharp"),
    ],
)
def test_answers_that_are_no_numbers_are_refused(network):
    with pytest.raises(ModelError, match="network"):
        learned_sharpness(level_of(Mesh(*bumpy_sphere())), rule_with(network))


def test_automatic_creases_are_those_of_the_network():
    """As sharp as it says, for the levels on the card, beside what is named; and by name alike."""
    scheme, mesh = pns(sharpening_model()), Mesh(*bumpy_sphere())
    made = refine(mesh, scheme, 3)
    w = learned_sharpness(level_of(mesh), scheme.rule)
    first, second, third = made.topologies
    np.testing.assert_array_equal(first.soft, w)
    np.testing.assert_array_equal(np.sort(second.soft)[-2 * len(w) :], np.sort(np.repeat(w, 2)))
    assert len(third.soft) == 0
    counts = [level["edges"].get("soft", 0) for level in made.report["levels"]]
    assert counts == [(w > 1 / 2).sum(), 2 * (w > 1 / 2).sum(), 0]
    assert counts[0] > 0
    named = creases_by_name(mesh, scheme.creases, scheme)
    again = refine(mesh, scheme, 3, creases=named)
    np.testing.assert_array_equal(again.mesh.vertices, made.mesh.vertices)
    marked = refine(mesh, scheme, 1, creases=named.with_named(first.edges[:3].astype(int)))
    assert marked.report["levels"][0]["edges"]["crease"] == 3
    expected = first.edges[w > 1 / 2]
    found = sharp_edges(mesh, scheme=scheme)
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, expected.tolist()))


def test_a_budget_of_0_is_the_base_scheme_without_sharp_edges():
    mesh = Mesh(*bumpy_sphere())
    made = refine(mesh, pns(sharpening_model(), 0), 2).mesh.vertices
    np.testing.assert_array_equal(made, refine(mesh, loop(), 2).mesh.vertices)


@given(manifolds(), seeds)
def test_the_whole_rule_does_not_depend_on_how_a_mesh_is_seen(mesh, seed):
    """Other numbers, mirrored, turned over: the same surface, with any sharpness network."""
    card = replace(DEFAULT_CARD, sharpness_features="crease-53")
    scheme = pns(ZeroModel(card))
    assert scheme.rule is not None
    scheme = replace(scheme, rule=replace(scheme.rule, sharpness_network=random_network(seed)))
    expected = refine(mesh, scheme, 1).mesh.vertices
    mirror = [-1.0, 1, 1]
    for twin, back in (
        (renumbered(mesh, seed), 1),
        (mirrored(mesh), mirror),
        (turned_over(mesh), 1),
    ):
        made = refine(twin.mesh, scheme, 1).mesh.vertices[twin.place]
        np.testing.assert_allclose(made * back, expected, atol=1e-9)


@given(manifolds(), seeds)
def test_soft_edges_keep_the_promises_of_a_guarded_and_bounded_step(mesh, seed):
    """Ratio, turns of neighbours and distance from smooth Loop, whatever the networks say."""
    scheme = pns(sharpening_model(seed % 7, scale=5.0, fold_angle=50.0))
    made = refine(mesh, scheme, 1)
    assert made.ratio.max() <= 1 + 1e-12
    parent = made.topologies[0]
    base = LOOP.place(mesh.vertices, parent, Blocks())
    before, after = (turns_of(base, made.mesh), turns_of(made.mesh.vertices, made.mesh))
    assert (after <= before + np.radians(2 * 50.0) + 1e-6).all()
    ours, theirs = refine(mesh, scheme, 2, limit=True), refine(mesh, loop(), 2, limit=True)
    apart = np.linalg.norm(ours.mesh.vertices - theirs.mesh.vertices, axis=1).max()
    assert apart <= ours.report["limit_distance"] * (1 + 1e-9) + 1e-12


def turns_of(points, mesh):
    """Angles between neighbours."""
    topology = mesh.topology()
    sides = topology.half_edges[topology.interior] // 3
    a, b, c = (points[mesh.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    n, m = (normals[sides[:, k]] for k in (0, 1))
    return np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(axis=1))
