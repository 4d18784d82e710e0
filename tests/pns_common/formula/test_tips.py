"""Tips: λ and what is left behind by Loop's limits, and what becomes of spikes and spheres."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.formula.prior import clear_normals, normal_pushes
from pns_common.formula.tips import (
    CURVE_FURTHER,
    bends_most,
    far_behind,
    kept_at_tips,
    left_behind,
    ring_further,
)
from pns_common.masks.limit import limit_positions
from pns_common.masks.stencils import loop_vertex_vertices
from pns_common.rules.control_level import control_level
from tests.support.meshes import bumpy_sphere, grid, icosphere, manifolds, soups, tilted_plane
from tests.support.networks import scale_free_model
from tests.support.prior_step import assert_numpy_and_torch_agree, prior_step

# The prior alone, its gates open: what becomes of a vertex is what the tips make of it.
OPEN = {"budget": 1e6, "vertex_gate_sharpness": 1e9, "gate_sharpness": 1e9}
KEPT, WITHOUT = (
    pns(scale_free_model(scale=0, tip_strength=a, fold_angle=89.0, **OPEN)) for a in (1.0, None)
)


def fan(sides, tip):
    """A fan of faces around (0, 0, tip), inside a flat sheet of two rings."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    inner = np.stack([i, j, np.full(sides, 2 * sides)], axis=1)
    outer = [np.stack([i + sides, j + sides, j], 1), np.stack([i + sides, j, i], 1)]
    return Mesh(np.concatenate([ring, 2 * ring, [[0, 0, tip]]]), np.concatenate([inner, *outer]))


@pytest.mark.parametrize("sides", range(3, 13))
def test_the_limit_is_further_times_as_far_as_the_first_step(sides):
    mesh = fan(sides, 1.0)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    first = loop_vertex_vertices(mesh.vertices, topology) - mesh.vertices
    whole = limit_positions(mesh.vertices, topology) - mesh.vertices
    np.testing.assert_allclose(whole[-1], ring_further(np.array([sides])) * first[-1], rtol=1e-12)
    rim = slice(sides, 2 * sides)
    np.testing.assert_allclose(whole[rim], CURVE_FURTHER * first[rim], rtol=0, atol=1e-14)


def test_what_is_left_behind_is_a_vertex_less_the_limit_of_all_pushed():
    points, faces = bumpy_sphere(2)
    level = control_level(points, build_topology(faces, len(points)))
    pushes = normal_pushes(level.rings)
    pushed, moved = (loop_vertex_vertices(x, level.topology) for x in (pushes, points))
    further = ring_further(level.topology.valence)[:, None]
    left = left_behind(pushes, pushed, moved - points, further)
    expected = points - limit_positions(points + pushes, level.topology)
    np.testing.assert_allclose(left, expected, rtol=0, atol=1e-14)


def test_a_tip_rises_from_one_share_to_another_and_with_how_much_more_it_bends():
    shares = np.array([0, 1 / 20, 2 / 20, 3 / 20, 9])[:, None]
    expected = [[0], [0], [0.5], [1], [1]]
    np.testing.assert_allclose(far_behind(2 * shares, np.full((5, 1), 2.0)), expected, atol=1e-12)
    bends = np.array([0.4, 1.0, 1.5, 2.0, 5.0])[:, None]
    np.testing.assert_allclose(bends_most(3 * bends, np.full((5, 1), 3.0)), expected, atol=1e-12)
    # Vertices all of whose neighbours lie where they are, or on planes.
    nothing = np.zeros((5, 1))
    assert not far_behind(shares, nothing).any()
    assert not bends_most(nothing, nothing).any()


def test_what_is_given_back_takes_the_place_of_the_prior():
    prior, moved = np.random.default_rng(0).standard_normal((2, 3, 3))
    made = kept_at_tips(prior, moved, np.array([[0.0], [0.5], [1.0]]), 0.8)
    expected = [prior[0], prior[1] / 2 - 0.4 * moved[1], -0.8 * moved[2]]
    np.testing.assert_allclose(made, expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("sides", [3, 4])
def test_a_spike_stays_where_it_is(sides):
    """To the last bit of what its budget and the fold guard allow: these allow all."""
    mesh = fan(sides, 1.2)
    kept, without = (refine(mesh, rule, 1).mesh.vertices[2 * sides] for rule in (KEPT, WITHOUT))
    np.testing.assert_allclose(kept, mesh.vertices[-1], rtol=0, atol=1e-12)
    assert without[2] < 0.95 * kept[2]


OCTAHEDRON = Mesh(
    np.concatenate([np.eye(3), -np.eye(3)]),
    [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]],
)
SMOOTH = {
    "octahedron": OCTAHEDRON,
    "icosahedron": Mesh(*icosphere(0)),
    "sphere": Mesh(*icosphere(2)),
    "plane": tilted_plane(0),
    "sheet": Mesh(*grid(5)),
}


@pytest.mark.parametrize("mesh", SMOOTH.values(), ids=SMOOTH)
def test_what_may_stand_for_something_smooth_has_no_tips(mesh):
    kept, without = (refine(mesh, rule, 1).mesh.vertices for rule in (KEPT, WITHOUT))
    np.testing.assert_allclose(kept, without, rtol=0, atol=1e-15)


def test_an_octahedron_is_left_behind_and_finer_spheres_less_and_less():
    for mesh, expected in (
        (OCTAHEDRON, 0.225),
        (Mesh(*icosphere(0)), 0.081),
        (Mesh(*icosphere(1)), 0.0155),
    ):
        points = mesh.vertices
        level = control_level(points, build_topology(mesh.faces, len(points)))
        pushes = normal_pushes(level.rings)
        left = points - limit_positions(points + pushes, level.topology)
        lengths = np.abs((left * clear_normals(level.rings.normal)).sum(axis=1))
        share = (lengths / level.rings.spoke_length[:, 0]).max()
        assert share == pytest.approx(expected, abs=1e-3)


@given(manifolds() | soups(), st.floats(1e-3, 1e6), st.floats(0.1, 3))
def test_tips_stay_within_the_budget_and_nothing_folds(mesh, budget, strength):
    model = scale_free_model(
        0, 2.0, boundary_strength=1.0, crease_prior=True, tip_strength=strength
    )
    refined = refine(mesh, pns(model, budget))
    assert refined.ratio.max() <= 1 + 1e-12
    assert refined.report["levels"][0]["flipped_faces"] == 0


@given(manifolds() | soups())
def test_numpy_and_torch_agree(mesh):
    assert_numpy_and_torch_agree(mesh, boundary_strength=0.7, tip_strength=0.8)


def test_torch_differentiates_through_it():
    mesh = fan(5, 0.8)
    points = mesh.vertices + 0.05 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    topology = build_topology(mesh.faces, len(points))
    tensor = torch.tensor(points, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda p: prior_step(p, topology, torch, boundary_strength=0.7, tip_strength=0.8),
        (tensor,),
        fast_mode=True,
    )
