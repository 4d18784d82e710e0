"""The boundary's prior: made of the boundary alone, bounded, and nothing where it is straight."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.formula.boundary_prior import boundary_pushes, boundary_vertices
from pns_common.levels.step import level_step
from pns_common.masks.limit import limit_positions
from pns_common.rules.control_level import control_level
from pns_common.schemes import (
    edge_operator,
    scale_free_form,
    scale_free_scheme,
    vertex_operator,
)
from tests.support.meshes import bent, grid, manifolds, soups
from tests.support.networks import SCALE_FREE_CARD, scale_free_model

STRONG, WITHOUT = (scale_free_model(0, 2.0, boundary_strength=b) for b in (1.0, None))


def cone(rim, tip):
    """A fan of faces from a closed rim to a tip."""
    around, count = np.arange(len(rim)), len(rim)
    faces = np.stack([around, (around + 1) % count, np.full(count, count)], axis=1)
    return Mesh(np.concatenate([rim, [tip]]), faces)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_two_pieces_with_a_common_boundary_meet_again(seed):
    """Their surfaces differ; the rim and its new vertices move alike, level by level."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(12) / 12
    rim = np.stack([np.cos(angle), np.sin(angle), 0.1 * rng.standard_normal(12)], axis=1)
    pieces = [cone(rim, [0.1, 0, 1.0]), cone(rim, [0, 0.2, -0.5])]
    refined = [refine(mesh, pns(STRONG, 1e3), 2, 1.0) for mesh in pieces]
    base = refine(pieces[0], loop(), 2).mesh.vertices
    assert np.abs(refined[0].mesh.vertices[:12] - base[:12]).max() > 1e-3
    rims = []
    for piece in refined:
        topology = build_topology(piece.mesh.faces, len(piece.mesh.vertices))
        rims.append(piece.mesh.vertices[boundary_vertices(topology)])
    assert len(rims[0]) == 48
    np.testing.assert_array_equal(rims[0], rims[1])


def test_straight_boundaries_and_right_angles_stay():
    points, faces = grid(6)
    topology = build_topology(faces, len(points))
    assert boundary_vertices(topology).sum() == 20
    assert (boundary_pushes(points, topology, 1e3) == 0).all()


def test_the_boundary_of_a_disc_keeps_its_radius():
    """Quasi-interpolation of a circle: what is left is of a higher order."""
    angle = 2 * np.pi * np.arange(16) / 16
    rim = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.cos(2 * angle)], axis=1)
    mesh = cone(rim, [0, 0, 0.0])
    rims = [
        refine(mesh, pns(model), 1, limit=True).mesh.vertices[:16] for model in (STRONG, WITHOUT)
    ]
    moved, plain = (np.abs(np.linalg.norm(r[:, :2], axis=1) - 1).max() for r in rims)
    assert moved < plain / 5
    topology = build_topology(mesh.faces, 17)
    np.testing.assert_allclose(rims[1], limit_positions(mesh.vertices, topology)[:16], atol=1e-12)


@given(manifolds() | soups(), st.floats(1e-3, 1e6))
def test_boundaries_stay_within_the_budget_and_nothing_folds(mesh, budget):
    refined = refine(mesh, pns(STRONG, budget))
    assert refined.ratio.max() <= 1 + 1e-12
    assert refined.report["levels"][0]["flipped_faces"] == 0


@given(manifolds())
def test_without_a_strength_boundaries_are_loops(mesh):
    corrected, base = (refine(mesh, scheme).mesh.vertices for scheme in (pns(WITHOUT), loop()))
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = np.flatnonzero(boundary_vertices(topology))
    np.testing.assert_array_equal(corrected[rows], base[rows])


def step_on(points, topology, xp):
    """The prior alone."""
    form = replace(scale_free_form(SCALE_FREE_CARD, 20.0), boundary_strength=0.7)
    edges = replace(edge_operator(STRONG), network=lambda rows: xp.zeros_like(rows[:, :3]))
    vertices = replace(vertex_operator(STRONG), network=lambda rows: xp.zeros_like(rows[:, :3]))
    return level_step(
        control_level(points, topology), scale_free_scheme(edges, vertices, form)
    ).points


@given(manifolds() | soups())
def test_numpy_and_torch_agree(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    ours = step_on(mesh.vertices, topology, np)
    theirs = step_on(torch.tensor(mesh.vertices), topology, torch)
    scale = max(1.0, np.abs(mesh.vertices).max())
    np.testing.assert_allclose(ours, theirs.numpy(), rtol=0, atol=1e-12 * scale)


def test_torch_differentiates_through_it():
    points, faces = grid(3, bent)
    points = points + 0.05 * np.random.default_rng(0).standard_normal(points.shape)
    topology = build_topology(faces, len(points))
    tensor = torch.tensor(points, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda p: step_on(p, topology, torch), (tensor,), fast_mode=True
    )
