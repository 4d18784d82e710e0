"""Promises of the construction, for any weights, on any mesh, at any level."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pns_common import Mesh, loop, pns
from pns_common.mesh.topology import EdgeClass, build_topology
from pns_common.operator.formula import edge_inputs
from pns_common.refinement import control_level
from tests.support.control_points import refine
from tests.support.meshes import (
    axis_planes,
    bent,
    bumpy_sphere,
    grid,
    manifolds,
    rotation,
    soups,
    tilted_plane,
)
from tests.support.networks import Float64Model, huge_model, random_layers, random_model
from train.certificates.plain import plain_loop

MODELS = [random_model(0), random_model(1, scale=30.0), huge_model(2)]
models = st.sampled_from(MODELS)
ROUNDING = 1 + 1e-12


@given(soups() | manifolds(), models, st.floats(1e-3, 1e3), st.sampled_from(["auto", 0.3, 1.0]))
def test_displacement_within_budget(mesh, model, budget, reference_length):
    """‖q − q0‖ ≤ C h² / R, from the output positions and an independent Loop step.

    That step knows no faces that name a vertex twice.
    """
    proper = mesh.faces[(mesh.faces != np.roll(mesh.faces, 1, axis=1)).all(axis=1)]
    assume(len(proper))
    mesh = Mesh(mesh.vertices, proper)
    refined = refine(mesh, pns(model, budget), 1, reference_length=reference_length)
    base = plain_loop(mesh.vertices, mesh.faces).positions
    length = refined.report["reference_length"]
    topology = build_topology(mesh.faces, len(mesh.vertices))
    a, b = (mesh.vertices[topology.edges[:, end]] for end in (0, 1))
    envelope = budget / length * np.sum((b - a) ** 2, axis=1) if length else np.zeros(len(a))
    apart = np.linalg.norm(refined.mesh.vertices - base, axis=1)
    # Positions are rounded to the size of their coordinates.
    rounding = 1e-15 * np.abs(mesh.vertices).max() * 8
    scale = np.maximum(envelope, np.abs(mesh.vertices).max())
    assert (apart[len(mesh.vertices) :] <= envelope + rounding + 1e-14 * scale).all()
    assert (apart[: len(mesh.vertices)] <= rounding).all()
    assert refined.ratio.max() <= ROUNDING


@given(soups() | manifolds(), models)
def test_only_interior_edges_are_corrected(mesh, model):
    refined = refine(mesh, pns(model), 1)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    elsewhere = topology.edge_class != EdgeClass.INTERIOR
    at_edges = slice(len(mesh.vertices), None)
    a, b = (mesh.vertices[topology.edges[elsewhere, end]] for end in (0, 1))
    np.testing.assert_array_equal(refined.mesh.vertices[at_edges][elsewhere], (a + b) / 2)
    assert (refined.ratio[at_edges][elsewhere] == 0).all()


def moved_apart(mesh, model, seed):
    """Return how far refining fails to commute with a random rigid motion, at each vertex."""
    rng = np.random.default_rng(seed)
    turn, shift = rotation(rng), rng.standard_normal(3)
    still = refine(mesh, pns(model), 1)
    after = refine(Mesh(mesh.vertices @ turn.T + shift, mesh.faces), pns(model), 1)
    assert still.report["levels"][0]["degenerate_frames"] == 0
    return np.linalg.norm(after.mesh.vertices - (still.mesh.vertices @ turn.T + shift), axis=1)


@given(manifolds(), st.integers(0, 2**31))
def test_commutes_with_rigid_motion(mesh, seed):
    assert moved_apart(mesh, Float64Model(random_layers(3)), seed).max() < 1e-12


@given(manifolds(), st.integers(0, 2**31))
def test_commutes_with_rigid_motion_through_a_model_file(mesh, seed):
    """The file reads single precision: a feature's last bit may move η by 1e-6 of the budget."""
    longest = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    length = refine(mesh, loop(), 1).report["reference_length"]
    model = MODELS[0]
    allowed = 1e-12 + 1e-6 * model.card.budget / length * longest**2
    assert moved_apart(mesh, model, seed).max() <= allowed


@pytest.mark.parametrize("model", MODELS)
def test_planar_input_gives_loop_exactly_on_axis_aligned_planes(model):
    for mesh in axis_planes():
        for levels in (1, 3):
            refined, base = refine(mesh, pns(model), levels), refine(mesh, loop(), levels)
            np.testing.assert_array_equal(refined.mesh.vertices, base.mesh.vertices)


@given(models, st.integers(0, 2**31))
def test_planar_input_gives_loop_in_any_orientation(model, seed):
    mesh = tilted_plane(seed)
    scheme = pns(model)
    refined = refine(mesh, scheme, 1)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    inside = topology.interior
    a, b = (mesh.vertices[topology.edges[inside, end]] for end in (0, 1))
    square = np.sum((b - a) ** 2, axis=1)
    delta = refined.ratio[len(mesh.vertices) :][inside] * model.card.budget * square
    assert (delta < 1e-28 * square).all()


@given(manifolds(), st.integers(-20, 20))
def test_scaling_a_mesh_scales_the_result(mesh, power):
    scale = 2.0**power  # exact in binary, so the comparison may be exact but for R's square root
    scheme = pns(MODELS[0])
    small = refine(mesh, scheme, 2).mesh.vertices
    large = refine(Mesh(scale * mesh.vertices, mesh.faces), scheme, 2).mesh.vertices
    np.testing.assert_allclose(large / scale, small, rtol=0, atol=1e-13)


def test_halving_the_reference_length_doubles_the_correction():
    mesh = Mesh(*bumpy_sphere())
    base = refine(mesh, loop(), 1).mesh.vertices
    whole = refine(mesh, pns(MODELS[0]), 1, reference_length=1.0).mesh.vertices - base
    half = refine(mesh, pns(MODELS[0]), 1, reference_length=0.5).mesh.vertices - base
    np.testing.assert_allclose(half, 2 * whole, rtol=0, atol=1e-15)


@given(soups(), models)
def test_degenerate_frames_are_rotations_and_features_finite(mesh, model):
    scheme = pns(model)
    level = control_level(mesh, scheme, 1.0)
    at = edge_inputs(level, scheme.rule, level.topology.interior)
    frames = at.basis.reshape(-1, 3, 3)
    identity = np.einsum("eji,eki->ejk", frames, frames)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-9)
    assert (np.linalg.det(frames) > 0).all()
    assert np.isfinite(at.features).all()


def test_faces_without_area_do_not_disturb_a_plane():
    """A sliver inside a flat patch has no normal: the gate stays shut there."""
    vertices = np.array([[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, 0, 0], [1, -1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 4, 3], [3, 4, 1]])
    mesh = Mesh(vertices, faces)
    refined = refine(mesh, pns(MODELS[2]), 1)
    np.testing.assert_array_equal(refined.mesh.vertices, refine(mesh, loop(), 1).mesh.vertices)
    assert refined.report["levels"][0]["degenerate_frames"] == 3


def test_zero_reference_length_switches_the_correction_off():
    points = np.zeros((4, 3)) + 2.0
    mesh = Mesh(points, np.array([[0, 1, 2], [0, 2, 3]]))
    refined = refine(mesh, pns(MODELS[0]), 1)
    assert refined.report["reference_length"] == 0
    np.testing.assert_array_equal(refined.mesh.vertices, 2.0)


def test_trained_levels_stay_within_the_envelope_at_every_level():
    mesh = Mesh(*grid(7, bent))
    report = refine(mesh, pns(MODELS[1]), 4).report
    assert all(0 < level["proximity_ratio"]["max"] <= ROUNDING for level in report["levels"])
