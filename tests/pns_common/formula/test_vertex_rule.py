"""The learned vertex rule keeps every promise of the edge rule, word for word."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ModelError, loop, pns, refine
from pns_common.connectivity.topology import EdgeClass, build_topology, split
from pns_common.features.ring_features import RING_10
from pns_common.geometry.frames import face_normals
from pns_common.schemes import VertexModel
from tests.support.meshes import (
    axis_planes,
    bent,
    bow_tie,
    bumpy_sphere,
    grid,
    icosphere,
    manifolds,
    rotation,
    soups,
    tilted_plane,
)
from tests.support.networks import CARD, Float64Model, float64_network, random_layers
from tests.support.renumbering import ASSETS, MIRROR, asset, mirrored, renumbered, turned_over

ROUNDING = 1 + 1e-12
VERTEX_CARD = replace(CARD, format=2, vertex_features="ring-10", vertex_gate_sharpness=10.0)
EDGES = Float64Model(random_layers(3))


class TwoNetworks(Float64Model):
    """Edge and vertex perceptrons in double precision; ``scale`` makes the vertex one loud."""

    card = VERTEX_CARD

    def __init__(self, seed, scale=1.0, odd=True):
        super().__init__(random_layers(seed))
        layers = random_layers(seed + 1, (RING_10.count, 32, 3), scale)
        self.vertex_network = averaged(float64_network(layers)) if odd else float64_network(layers)

    def vertex_correction(self, features, budget):
        return budget * self.vertex_network(features)


def averaged(network):
    """The mean over the ring's symmetries."""
    group = RING_10.symmetries

    def mean(features):
        images = [
            network(features[:, o] * s) * d
            for o, s, d in zip(group.order, group.signs, group.local, strict=True)
        ]
        return sum(images) / len(images)

    return mean


class Unbounded(TwoNetworks):
    """A hostile model: weights of about 10⁶ budgets."""

    def vertex_correction(self, features, budget):
        return 1e6 * super().vertex_correction(features, budget)


MODELS = [TwoNetworks(0), TwoNetworks(1, scale=30.0, odd=False), Unbounded(2)]
models = st.sampled_from(MODELS)


def departure(mesh, model, reference_length=1.0, budget=None):
    """How far the old vertices are from Loop's."""
    refined = refine(mesh, pns(model, budget), reference_length=reference_length)
    base = refine(mesh, loop(), reference_length=reference_length)
    count = len(mesh.vertices)
    return refined.mesh.vertices[:count] - base.mesh.vertices[:count]


def ring_lengths(mesh):
    """The edge lengths around each vertex, the slow way."""
    lengths = [[] for _ in mesh.vertices]
    for a, b in build_topology(mesh.faces, len(mesh.vertices)).edges.tolist():
        length = float(np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]))
        lengths[a].append(length)
        lengths[b].append(length)
    return lengths


@given(soups() | manifolds(), models, st.floats(1e-3, 1e3), st.sampled_from(["auto", 0.3, 1.0]))
def test_displacement_within_budget(mesh, model, budget, reference_length):
    """‖p' − p0‖ ≤ (C / R) h_v², h_v the root mean square of the ring: T1 for old vertices."""
    refined = refine(mesh, pns(model, budget), reference_length=reference_length)
    length = refined.report["reference_length"]
    apart = np.linalg.norm(departure(mesh, model, reference_length, budget), axis=1)
    square = np.array([np.mean(np.square(ring)) if ring else 0.0 for ring in ring_lengths(mesh)])
    envelope = budget / length * square if length else np.zeros(len(apart))
    rounding = 1e-14 * np.maximum(envelope, np.abs(mesh.vertices).max())
    assert (apart <= envelope + rounding).all()
    assert refined.ratio.max() <= ROUNDING


@given(soups() | manifolds(), models)
def test_only_closed_rings_of_interior_edges_are_moved(mesh, model):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    sharp = topology.edges[topology.edge_class != EdgeClass.INTERIOR].reshape(-1)
    fixed = np.ones(len(mesh.vertices), dtype=bool)
    fixed[topology.edges.reshape(-1)] = False
    fixed[sharp] = True
    assert not topology.smooth_vertices[fixed].any()
    refined = refine(mesh, pns(model))
    base = refine(mesh, loop()).mesh.vertices
    np.testing.assert_array_equal(
        refined.mesh.vertices[: len(fixed)][fixed], base[: len(fixed)][fixed]
    )
    assert (refined.ratio[: len(fixed)][fixed] == 0).all()


def test_a_vertex_of_two_closed_fans_follows_loop():
    points, faces = icosphere(0)
    twice = np.concatenate([points, points + 2 * points[:1]])
    other = faces + len(points)
    apex = int(np.argmin(np.linalg.norm(twice[len(points) :] - points[0], axis=1)))
    twice[len(points) + apex] = points[0]
    other[other == len(points) + apex] = 0
    mesh = Mesh(twice, np.concatenate([faces, other]))
    moved = np.linalg.norm(departure(mesh, MODELS[0]), axis=1) > 0
    assert not moved[0]
    assert moved[1:].any()
    assert not build_topology(*bow_tie()[1:], 5).smooth_vertices.any()


@given(manifolds(), st.integers(0, 2**31))
def test_commutes_with_rigid_motion(mesh, seed):
    rng = np.random.default_rng(seed)
    turn, shift = rotation(rng), rng.standard_normal(3)
    moved = Mesh(mesh.vertices @ turn.T + shift, mesh.faces)
    apart = departure(moved, MODELS[0]) - departure(mesh, MODELS[0]) @ turn.T
    assert np.abs(apart).max() < 1e-12


@pytest.mark.parametrize("model", MODELS)
def test_planar_input_gives_loop_exactly_on_axis_aligned_planes(model):
    for mesh in axis_planes():
        for levels in (1, 3):
            refined, base = refine(mesh, pns(model), levels), refine(mesh, loop(), levels)
            np.testing.assert_array_equal(refined.mesh.vertices, base.mesh.vertices)


@given(models, st.integers(0, 2**31))
def test_planar_input_gives_loop_in_any_orientation(model, seed):
    mesh = tilted_plane(seed)
    refined = refine(mesh, pns(model))
    # δ ≤ C γ_v h_v², and γ_v is what the ratio cannot exceed.
    assert refined.gate[: len(mesh.vertices)].max() * model.card.budget < 1e-28


def test_faces_without_area_do_not_disturb_a_plane():
    vertices, faces = grid(4)
    vertices[5] = vertices[6]  # two faces collapse
    mesh = Mesh(vertices, faces)
    positions = refine(mesh, pns(MODELS[2])).mesh.vertices
    np.testing.assert_array_equal(positions, refine(mesh, loop()).mesh.vertices)


@pytest.mark.parametrize("model", MODELS)
def test_scaling_slopes_are_two_and_one(model):
    vertices, faces = grid(7, bent)
    topology = build_topology(faces, len(vertices))
    scales = 2.0 ** -np.arange(4, 11)
    distances, turns = [], []
    for scale in scales:
        mesh = Mesh(scale * vertices, faces)
        distances.append(np.linalg.norm(departure(mesh, model), axis=1).max())
        corrected, base = (
            refine(mesh, scheme, reference_length=1.0).mesh.vertices
            for scheme in (pns(model), loop())
        )
        apart = face_normals(corrected, split(topology)) - face_normals(base, split(topology))
        turns.append(np.linalg.norm(apart, axis=1).max())
    assert np.polyfit(np.log(scales), np.log(distances), 1)[0] == pytest.approx(2, abs=1e-3)
    assert np.polyfit(np.log(scales), np.log(turns), 1)[0] == pytest.approx(1, abs=2e-2)


@pytest.mark.parametrize("valence", range(3, 13))
def test_a_planar_star_has_loops_linearisation(valence):
    """γ_v = O(ε²): the departure of a lifted planar star falls as ε², so its derivative is 0."""
    angle = 2 * np.pi * np.arange(valence) / valence
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    flat = np.concatenate([[[0.0, 0, 0]], ring])
    around = np.arange(valence)
    faces = np.stack([0 * around, 1 + around, 1 + (around + 1) % valence], axis=1)
    move = np.random.default_rng(valence).standard_normal(flat.shape)
    sizes = [
        np.linalg.norm(departure(Mesh(flat + epsilon * move, faces), MODELS[2])[0])
        for epsilon in (1e-3, 1e-4, 1e-5)
    ]
    assert sizes[0] < 1e-3
    assert sizes[0] / sizes[1] > 50
    assert sizes[1] / sizes[2] > 90


def test_moves_of_size_epsilon_change_the_result_by_a_multiple_of_it():
    mesh = Mesh(*bumpy_sphere())
    move = np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    still = departure(mesh, MODELS[0])
    epsilons = 10.0 ** -np.arange(3, 8)
    changes = [
        np.abs(departure(Mesh(mesh.vertices + e * move, mesh.faces), MODELS[0]) - still).max()
        for e in epsilons
    ]
    assert np.polyfit(np.log(epsilons), np.log(changes), 1)[0] == pytest.approx(1, abs=0.05)


def vertices_apart(mesh, twin, expected=lambda positions: positions):
    """Old vertices of a twin against where they should be; edges are left to Loop."""
    count = len(mesh.vertices)
    wanted = expected(departure(mesh, MODELS[0]))
    return np.abs(departure(twin.mesh, MODELS[0])[twin.place[:count]] - wanted).max()


def reflected(vectors):
    return vectors * MIRROR


@given(manifolds(), st.integers(0, 2**31))
def test_numbering_mirrors_and_turned_faces_change_nothing(mesh, seed):
    assert vertices_apart(mesh, renumbered(mesh, seed)) < 1e-12
    assert vertices_apart(mesh, mirrored(mesh), reflected) < 1e-12
    assert vertices_apart(mesh, turned_over(mesh)) < 1e-12


@pytest.mark.parametrize("name", ASSETS)
def test_numbering_mirrors_and_turned_faces_change_nothing_on_assets(name):
    mesh = asset(name)
    assert vertices_apart(mesh, renumbered(mesh, 0)) < 1e-11
    assert vertices_apart(mesh, mirrored(mesh), reflected) < 1e-11
    assert vertices_apart(mesh, turned_over(mesh)) < 1e-11


def test_the_report_says_what_the_vertex_rule_did():
    mesh = Mesh(*grid(5, bent))
    refined = refine(mesh, pns(MODELS[1]), 2)
    first, second = refined.report["levels"]
    assert first["vertex_rule"]["vertices"] == 9
    inner = refined.ratio[: first["vertices"]]
    assert second["vertex_rule"]["proximity_ratio"]["max"] == inner.max() > 0
    assert second["vertex_rule"]["gate"]["max"] == refined.gate[: first["vertices"]].max()
    plain = refine(mesh, pns(EDGES), 2)
    assert "vertex_rule" not in plain.report["levels"][0]
    assert (plain.ratio[: first["vertices"]] == 0).all()


def test_a_card_that_names_vertex_features_needs_a_vertex_network():
    class Without(Float64Model):
        card = VERTEX_CARD

    assert isinstance(MODELS[0], VertexModel)
    with pytest.raises(ModelError, match="vertex network"):
        pns(Without(random_layers(0)))


def test_answers_that_are_not_finite_are_an_error():
    class Broken(TwoNetworks):
        def vertex_correction(self, features, budget):
            return np.full((len(features), 3), np.nan)

    with pytest.raises(ModelError, match="finite"):
        refine(Mesh(*bumpy_sphere()), pns(Broken(0)))
