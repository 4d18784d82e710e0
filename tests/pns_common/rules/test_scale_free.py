"""The rule of format 3: what the construction promises for any weights, on any mesh."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, pns, refine
from pns_common.connectivity.topology import build_topology, split
from pns_common.geometry.frames import face_normals
from pns_common.levels.step import level_step
from pns_common.rules.control_level import control_level
from pns_common.schemes import (
    edge_operator,
    scale_free_form,
    scale_free_scheme,
    vertex_operator,
)
from tests.support.meshes import (
    bent,
    bumpy_sphere,
    grid,
    icosphere,
    manifolds,
    proper_faces,
    rotation,
    soups,
    tilted_plane,
)
from tests.support.networks import SCALE_FREE_CARD, scale_free_model
from tests.support.quasi_interpolation import OPEN_GATES, quasi_interpolated, with_card

MODELS = [
    scale_free_model(0),
    scale_free_model(2, 200.0),
    scale_free_model(0, 0.0),
    scale_free_model(3, 20.0, side_gates=True),
    scale_free_model(4, 20.0, network_altitudes=2.0, wide_bound=True),
]
PRIOR_ALONE = MODELS[2]
models = st.sampled_from(MODELS)
ROUNDING = 1 + 1e-12
WIDTHS = {"edges": 18, "vertices": 10}


def turns(mesh, moved, base):
    """Angles between the faces of two refinements, in degrees, where Loop's have area."""
    a, b = (np.asarray(positions) for positions in (base, moved))
    normals = [face_normals(points, mesh) for points in (a, b)]
    corners = a[mesh]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    defined = area > 1e-6 * longest**2
    cosine = np.sum(normals[0] * normals[1], axis=1)[defined]
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def longest_side_square(mesh, edge):
    """Of the faces that have this edge, by brute force."""
    corners = mesh.vertices[mesh.faces[np.isin(mesh.faces, edge).sum(axis=1) == 2]]
    return np.sum((corners - np.roll(corners, 1, axis=1)) ** 2, axis=2).max()


@given(manifolds() | soups(), models, st.floats(1e-3, 1e6), st.sampled_from([5.0, 30.0, 75.0]))
def test_no_child_face_turns_by_more_than_the_fold_angle(mesh, model, budget, angle):
    """Against an independent reading of the angle, on one step."""
    model = with_card(model, fold_angle=angle)
    refined, base = refine(mesh, pns(model, budget)), refine(mesh, loop())
    assert turns(refined.mesh.faces, refined.mesh.vertices, base.mesh.vertices).max(initial=0) < (
        angle + 1e-3
    )


@given(manifolds() | soups(), models, st.floats(1e-3, 1e6), st.sampled_from(["auto", 0.3]))
def test_displacement_within_budget_at_edges_and_vertices(mesh, model, budget, reference_length):
    if model.card.wide_bound:
        mesh = proper_faces(mesh)  # so that its edges' two faces are those that hold both ends
    refined = refine(mesh, pns(model, budget), reference_length=reference_length)
    base = refine(mesh, loop()).mesh.vertices
    length = refined.report["reference_length"]
    topology = build_topology(mesh.faces, len(mesh.vertices))
    a, b = (mesh.vertices[topology.edges[:, end]] for end in (0, 1))
    square = np.sum((b - a) ** 2, axis=1)
    ring = np.zeros(len(mesh.vertices))
    for end in (0, 1):
        np.add.at(ring, topology.edges[:, end], square)
    ring /= np.maximum(np.bincount(topology.edges.reshape(-1), minlength=len(ring)), 1)
    if model.card.wide_bound:
        square = np.array([longest_side_square(mesh, edge) for edge in topology.edges])
    envelope = np.concatenate([ring, square]) * (budget / length if length else 0)
    apart = np.linalg.norm(refined.mesh.vertices - base, axis=1)
    rounding = 1e-14 * np.abs(mesh.vertices).max()
    assert (apart <= envelope * ROUNDING + rounding).all()
    assert refined.ratio.max() <= ROUNDING


@given(manifolds(), models)
def test_after_the_learned_levels_it_is_loop(mesh, model):
    """The result is Loop's subdivision of what the first level made."""
    once, thrice = (refine(mesh, pns(model), levels) for levels in (1, 3))
    expected = refine(once.mesh, loop(), 2).mesh
    np.testing.assert_array_equal(thrice.mesh.vertices, expected.vertices)


def test_two_learned_levels_act_at_two_levels():
    mesh = Mesh(*bumpy_sphere())
    model = scale_free_model(0, learned_levels=2)
    once, twice = (refine(mesh, pns(model), levels) for levels in (1, 2))
    assert np.abs(twice.mesh.vertices - refine(once.mesh, loop()).mesh.vertices).max() > 1e-3
    length = once.report["reference_length"]
    again = refine(once.mesh, pns(model), reference_length=length)
    np.testing.assert_array_equal(twice.mesh.vertices, again.mesh.vertices)


def test_without_a_network_one_level_is_quasi_interpolation():
    points, faces = bumpy_sphere(0, subdivisions=1, bump=0.05)
    found = refine(Mesh(points, faces), pns(with_card(PRIOR_ALONE, **OPEN_GATES)))
    expected = quasi_interpolated(points, faces)
    np.testing.assert_allclose(found.mesh.vertices, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("subdivisions", "least"), [(0, 65), (1, 85), (2, 90), (3, 90)])
def test_the_prior_alone_halves_the_error_on_spheres_of_any_resolution(subdivisions, least):
    mesh = Mesh(*icosphere(subdivisions))
    error = [
        np.abs(np.linalg.norm(refine(mesh, scheme, 3).mesh.vertices, axis=1) - 1).mean()
        for scheme in (pns(PRIOR_ALONE), loop())
    ]
    assert 100 * (1 - error[0] / error[1]) > least


@given(models, st.integers(0, 2**31))
def test_planar_input_gives_loop_in_any_orientation(model, seed):
    mesh = tilted_plane(seed)
    corrected, base = (refine(mesh, scheme, 3).mesh.vertices for scheme in (pns(model), loop()))
    np.testing.assert_allclose(corrected, base, rtol=0, atol=1e-14)


@given(manifolds(), models, st.integers(-20, 20))
def test_scaling_a_mesh_scales_the_result(mesh, model, power):
    scale = 2.0**power
    small = refine(mesh, pns(model), 2).mesh.vertices
    large = refine(Mesh(scale * mesh.vertices, mesh.faces), pns(model), 2).mesh.vertices
    np.testing.assert_allclose(large / scale, small, rtol=0, atol=1e-12)


@given(manifolds(), st.integers(0, 2**31), st.booleans())
def test_commutes_with_motions_and_reflections(mesh, seed, mirrored):
    """With the prior alone; a network has the symmetry that it was built with."""
    rng = np.random.default_rng(seed)
    turn, shift = rotation(rng) * (-1 if mirrored else 1), rng.standard_normal(3)
    still = refine(mesh, pns(PRIOR_ALONE), 2).mesh.vertices
    faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
    moved = refine(Mesh(mesh.vertices @ turn.T + shift, faces), pns(PRIOR_ALONE))
    once = refine(mesh, pns(PRIOR_ALONE)).mesh.vertices
    base = mesh.vertices @ turn.T + shift
    count = len(mesh.vertices)
    np.testing.assert_allclose(
        moved.mesh.vertices[:count], once[:count] @ turn.T + shift, atol=1e-12 * np.abs(base).max()
    )
    assert np.isfinite(still).all()


@given(manifolds() | soups())
def test_numpy_and_torch_take_the_same_step(mesh):
    ours, theirs = (step_on(mesh, xp) for xp in (np, torch))
    scale = max(1.0, np.abs(mesh.vertices).max())
    # A face may stand at the fold angle to the last bit; nothing else tells the backends apart.
    np.testing.assert_array_equal(ours.guard, theirs.guard)
    np.testing.assert_allclose(ours.points, theirs.points.numpy(), rtol=0, atol=1e-12 * scale)
    for own, twin in ((ours.edges, theirs.edges), (ours.vertices, theirs.vertices)):
        np.testing.assert_allclose(own.ratio, twin.ratio.numpy(), rtol=0, atol=1e-9)
        np.testing.assert_allclose(own.gate, twin.gate.numpy(), rtol=0, atol=1e-9)


def step_on(mesh, xp, points=None):
    """One step with tanh of random linear maps as networks, on either backend."""
    rng = np.random.default_rng(0)
    maps = {name: rng.standard_normal((width, 3)) for name, width in WIDTHS.items()}

    def network(name):
        return lambda rows: xp.tanh(rows @ xp.asarray(maps[name]))

    scheme = scale_free_scheme(
        replace(edge_operator(PRIOR_ALONE), network=network("edges")),
        replace(vertex_operator(PRIOR_ALONE), network=network("vertices")),
        scale_free_form(SCALE_FREE_CARD, 20.0),
    )
    topology = build_topology(mesh.faces, len(mesh.vertices))
    points = xp.asarray(mesh.vertices.copy()) if points is None else points
    return level_step(control_level(points, topology), scheme)


def test_torch_differentiates_through_the_guarded_step():
    """The guard acts here, and its factor is a number to the gradient."""
    mesh = Mesh(*bumpy_sphere(0, subdivisions=0, bump=0.5))
    points = torch.tensor(mesh.vertices, requires_grad=True)
    assert (step_on(mesh, torch).guard < 1).any()
    assert torch.autograd.gradcheck(
        lambda p: step_on(mesh, torch, p).points, (points,), fast_mode=True
    )


@given(soups())
def test_gradients_are_finite_on_degenerate_meshes(mesh):
    mesh = Mesh(mesh.vertices / np.abs(mesh.vertices).max(), mesh.faces)
    points = torch.tensor(mesh.vertices, requires_grad=True)
    step_on(mesh, torch, points).points.sum().backward()
    assert torch.isfinite(points.grad).all()


def test_the_products_step_is_the_training_step():
    mesh = Mesh(*grid(7, bent))
    topology = build_topology(np.array(mesh.faces), len(mesh.vertices))
    step = level_step(control_level(mesh.vertices, topology), pns(MODELS[0]))
    refined = refine(mesh, pns(MODELS[0]), reference_length=1.0)
    np.testing.assert_array_equal(step.points, refined.mesh.vertices)
    np.testing.assert_array_equal(split(topology), refined.mesh.faces)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_change_a_bit(threads):
    mesh = Mesh(*bumpy_sphere(0, subdivisions=5))
    alone, many = (refine(mesh, pns(MODELS[0]), threads=count) for count in (1, threads))
    np.testing.assert_array_equal(alone.mesh.vertices, many.mesh.vertices)
    assert alone.report == many.report
