"""The prior of curves: made of the curve alone, bounded, and nothing where it is straight."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, pns, refine
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.formula.curve_prior import (
    BOUNDARIES,
    BOUNDARIES_AND_CREASES,
    curve_direction,
    curve_gate,
    curve_mask,
    curve_pushes,
    find_curves,
)
from pns_common.masks.limit import limit_positions
from pns_common.masks.stencils import loop_vertex_vertices
from tests.support.meshes import bent, grid, manifolds, soups
from tests.support.networks import scale_free_model
from tests.support.prior_step import assert_numpy_and_torch_agree, prior_step

STRONG, WITHOUT = (scale_free_model(0, 2.0, boundary_strength=b) for b in (1.0, None))
OF_CREASES = scale_free_model(0, 2.0, boundary_strength=1.0, crease_prior=True)
WITH_TIPS = scale_free_model(0, 2.0, boundary_strength=1.0, tip_strength=1.0)


def cone(rim, tip):
    """A fan of faces from a closed rim to a tip."""
    around, count = np.arange(len(rim)), len(rim)
    faces = np.stack([around, (around + 1) % count, np.full(count, count)], axis=1)
    return Mesh(np.concatenate([rim, [tip]]), faces)


def test_the_gate_of_curves_falls_from_turns_of_60_degrees_to_those_of_90():
    turning = 1 - np.cos(np.radians([0, 10, 60, 90, 120]))
    half = 0.75  # half way in x
    sharp = curve_gate(np.append(turning, half), 1e9)
    np.testing.assert_allclose(sharp, [0, 1, 1, 0, 0, 0.5], atol=1e-9)


@pytest.mark.parametrize("turn", [0, 90, 150, 160, 180])
def test_a_curve_has_a_direction_up_to_turns_of_150_degrees_and_less_beyond(turn):
    angle = np.radians(180 - turn)
    a, b = np.array([[2.0, 0, 0]]), 2 * np.array([[np.cos(angle), np.sin(angle), 0]])
    length = np.linalg.norm(curve_direction(a, b))
    assert length == pytest.approx(min(1.0, 4 * np.sin(angle / 2)), abs=1e-12)
    assert (length > 1 - 1e-12) == (turn <= 150)


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
        rims.append(
            piece.mesh.vertices[find_curves(piece.mesh.vertices, topology, BOUNDARIES).rows]
        )
    assert len(rims[0]) == 48
    np.testing.assert_array_equal(rims[0], rims[1])


@given(manifolds() | soups(), st.integers(0, 99))
def test_the_curve_mask_is_what_loops_rule_makes_of_movable_vertices(mesh, seed):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    curves = find_curves(mesh.vertices, topology, BOUNDARIES)
    values = np.random.default_rng(seed).standard_normal((len(mesh.vertices), 3))
    expected = loop_vertex_vertices(values, topology)[curves.rows]
    np.testing.assert_array_equal(curve_mask(curves, values), expected)
    np.testing.assert_array_equal(
        mesh.vertices[curves.sides[:, 0]] - mesh.vertices[curves.rows], curves.a
    )


def test_a_push_undoes_what_the_curve_cuts_off_across_its_chord():
    rng = np.random.default_rng(0)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 24))
    rim = np.stack([np.cos(angle), np.sin(angle), 0.05 * rng.standard_normal(24)], axis=1)
    mesh = cone(rim, [0, 0, 0.5])
    pushes = curve_pushes(find_curves(mesh.vertices, build_topology(mesh.faces, 25), BOUNDARIES), 5)
    turns = set()
    for v in range(24):
        before, p, after = rim[v - 1], rim[v], rim[(v + 1) % 24]
        u, t = (before + after) / 2 - p, (after - before) / np.linalg.norm(after - before)
        first, second = ((q - p) / np.linalg.norm(q - p) for q in (before, after))
        x = 1 + first @ second
        gate = np.tanh(5 * x) * min(1, max(0, 2 * (1 - x)))
        turns.add(gate > 0)
        np.testing.assert_allclose(pushes[v], -gate / 3 * (u - (u @ t) * t), rtol=0, atol=1e-14)
    assert turns == {True, False}
    assert not pushes[24].any()


def test_straight_boundaries_and_right_angles_stay():
    points, faces = grid(6)
    topology = build_topology(faces, len(points))
    curves = find_curves(points, topology, BOUNDARIES)
    assert len(curves.rows) == 20
    assert (curve_pushes(curves, 1e3) == 0).all()


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


def two_cones(sides):
    """Two fans of faces on one rim, and the rim as creases."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    up, down = cone(rim, [0, 0, 1.0]).faces, cone(rim, [0, 0, -1.0]).faces[:, ::-1]
    faces = np.concatenate([up, np.where(down == sides, sides + 1, down)])
    around = np.arange(sides)
    creases = np.stack([around, (around + 1) % sides], axis=1)
    return Mesh(np.concatenate([rim, [[0, 0, 1.0], [0, 0, -1.0]]]), faces), creases


def test_a_round_crease_keeps_its_radius_where_the_card_says_so():
    mesh, creases = two_cones(16)
    rims = [
        refine(mesh, pns(model), 1, limit=True, creases=creases).mesh.vertices[:16]
        for model in (OF_CREASES, STRONG)
    ]
    moved, plain = (np.abs(np.linalg.norm(rim, axis=1) - 1).max() for rim in rims)
    assert moved < plain / 5
    topology = with_creases(build_topology(mesh.faces, 18), creases)
    np.testing.assert_allclose(rims[1], limit_positions(mesh.vertices, topology)[:16], atol=1e-12)


def test_a_line_of_creases_is_pushed_as_the_same_boundary():
    mesh, creases = two_cones(9)
    half = build_topology(mesh.faces[:9], len(mesh.vertices))
    whole = with_creases(build_topology(mesh.faces, len(mesh.vertices)), creases)
    open_, creased = (
        curve_pushes(find_curves(mesh.vertices, topology, BOUNDARIES_AND_CREASES), 1e3)
        for topology in (half, whole)
    )
    assert np.linalg.norm(creased[:9], axis=1).min() > 0.05
    np.testing.assert_array_equal(creased, open_)
    assert not curve_pushes(find_curves(mesh.vertices, whole, BOUNDARIES), 1e3).any()


def test_a_corner_of_a_sheet_stays_with_tips_on_the_card():
    """Loop cuts off half of the way to the middle of its sides."""
    mesh = Mesh(*grid(4))
    corners = [0, 3, 12, 15]
    kept, cut = (
        refine(mesh, pns(model, 1e6), 1).mesh.vertices[corners] for model in (WITH_TIPS, STRONG)
    )
    np.testing.assert_allclose(kept, mesh.vertices[corners], rtol=0, atol=1e-12)
    assert np.linalg.norm(cut - kept, axis=1).min() > 0.1
    other = np.setdiff1d(np.arange(16), corners)
    rest = [refine(mesh, pns(m, 1e6), 1).mesh.vertices[other] for m in (WITH_TIPS, STRONG)]
    np.testing.assert_allclose(rest[0], rest[1], rtol=0, atol=1e-15)


@pytest.mark.parametrize("apart", [[0, 0, 0], [1e-15, 0, 0], [0, 1e-15, 0], [0, 0, 1e-15]])
def test_where_a_boundary_turns_back_on_itself_rounding_decides_nothing(apart):
    """A disc with a slit whose sides lie side by side: from one to the other is no direction."""
    angle = np.linspace(0, 2 * np.pi, 9)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([np.zeros((1, 3)), rim])
    points[9] = points[1] + apart
    around = np.arange(1, 9)
    mesh = Mesh(points, np.stack([0 * around, around, around + 1], axis=1))
    tip = refine(mesh, pns(WITH_TIPS), 1, 1.0).mesh.vertices[0]
    assert np.abs(tip).max() < 1e-9


@given(manifolds() | soups(), st.floats(1e-3, 1e6))
def test_boundaries_stay_within_the_budget_and_nothing_folds(mesh, budget):
    refined = refine(mesh, pns(STRONG, budget))
    assert refined.ratio.max() <= 1 + 1e-12
    assert refined.report["levels"][0]["flipped_faces"] == 0


@given(manifolds())
def test_without_a_strength_boundaries_are_loops(mesh):
    corrected, base = (refine(mesh, scheme).mesh.vertices for scheme in (pns(WITHOUT), loop()))
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = find_curves(mesh.vertices, topology, BOUNDARIES).rows
    np.testing.assert_array_equal(corrected[rows], base[rows])


@given(manifolds() | soups())
def test_numpy_and_torch_agree(mesh):
    assert_numpy_and_torch_agree(mesh, boundary_strength=0.7)


def test_torch_differentiates_through_it():
    points, faces = grid(3, bent)
    points = points + 0.05 * np.random.default_rng(0).standard_normal(points.shape)
    topology = build_topology(faces, len(points))
    tensor = torch.tensor(points, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda p: prior_step(p, topology, torch, boundary_strength=0.7), (tensor,), fast_mode=True
    )
