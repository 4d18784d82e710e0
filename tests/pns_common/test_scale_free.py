"""The rule of format 3: what the construction promises for any weights, on any mesh."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, ModelError, loop, pns, refine
from pns_common.edge.frames import face_normals
from pns_common.level import control_level
from pns_common.linear import refine_linear
from pns_common.schemes import (
    edge_operator,
    scale_free_form,
    scale_free_scheme,
    vertex_operator,
)
from pns_common.side_gate import face_bends, gentle_bend, opened
from pns_common.step import level_step
from pns_common.topology import build_topology, split
from tests.support.meshes import bent, bumpy_sphere, grid, icosphere, manifolds, rotation, soups
from tests.support.networks import SCALE_FREE_CARD, scale_free_model, vertex_model

MODELS = [
    scale_free_model(0),
    scale_free_model(2, 200.0),
    scale_free_model(0, 0.0),
    scale_free_model(3, 20.0, side_gates=True),
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


@given(manifolds() | soups(), models, st.floats(1e-3, 1e6), st.sampled_from([5.0, 30.0, 75.0]))
def test_no_child_face_turns_by_more_than_the_fold_angle(mesh, model, budget, angle):
    """Against an independent reading of the angle, on one step."""
    model = with_card(model, fold_angle=angle)
    refined, base = refine(mesh, pns(model, budget)), refine(mesh, loop())
    assert turns(refined.mesh.faces, refined.mesh.vertices, base.mesh.vertices).max(initial=0) < (
        angle + 1e-3
    )


def with_card(model, **changes):
    """The same networks under another card."""
    return type(model)(model.name, replace(model.card, **changes), model.hash, *rest_of(model))


def rest_of(model):
    return [getattr(model, name) for name in list(model.__dataclass_fields__)[3:]]


@given(manifolds() | soups(), models, st.floats(1e-3, 1e6), st.sampled_from(["auto", 0.3]))
def test_displacement_within_budget_at_edges_and_vertices(mesh, model, budget, reference_length):
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


def test_side_gates_leave_quasi_interpolation_whole_where_two_faces_lie_in_one_plane():
    """On quads that are plane, cut in two, a gate of the two faces leaves their diagonals out."""
    points, faces = torus_of_quads(24, 14)
    expected = quasi_interpolated(points, faces)
    of_sides, of_faces = both_gates(points, faces)
    np.testing.assert_allclose(of_sides, expected, rtol=0, atol=1e-12)
    assert (np.abs(of_faces - expected).max(axis=1) > 1e-4).sum() > 200


def test_side_gates_open_the_walls_of_a_prism_of_one_row_and_not_its_lids():
    points, faces = prism(16)
    edges = build_topology(faces, len(points)).edges
    on_lid = np.concatenate([np.arange(len(points)) >= 32, (edges >= 32).any(axis=1)])
    of_sides, of_faces = both_gates(points, faces)
    expected = quasi_interpolated(points, faces)
    np.testing.assert_allclose(of_sides[~on_lid], expected[~on_lid], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(of_sides[on_lid], of_faces[on_lid])
    assert (np.abs(of_faces - of_sides).max(axis=1) > 1e-3).sum() == 16


def test_side_gates_stay_shut_on_flat_sides_between_right_angles():
    of_sides, of_faces = both_gates(*box_of_quads(4))
    np.testing.assert_array_equal(of_sides, of_faces)


def test_bends_count_while_they_are_gentle():
    """Of each face a third of x f(x), f from 1 at 0.3 to 0 at 0.6."""
    topology = build_topology(np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]), 4)
    beside = (topology.face_edges == 2).any(axis=1)
    assert beside.sum() == 2
    for x, counted in ((0.0, 0.0), (0.2, 0.2), (0.45, 0.225), (0.6, 0.0), (1.3, 0.0)):
        bends = face_bends(np.where(np.arange(6) == 2, x, 0.0), topology)
        np.testing.assert_allclose(bends, np.where(beside, counted / 3, 0.0), atol=1e-15)


def test_a_side_gate_opens_where_both_faces_bend():
    first, second = np.array([0, 1e-3, 0.1, 0.1]), np.array([0.1, 0.1, 0.2, 0.0])
    np.testing.assert_allclose(gentle_bend(first, second, 1e4), [0, 1, 1, 0], atol=1e-8)
    np.testing.assert_allclose(opened(np.array([0.0, 0.5, 1.0]), np.full(3, 0.5)), [0.5, 0.75, 1])


def both_gates(points, faces):
    """The prior alone on a mesh, with gates that read sides and with gates that do not."""
    models = (with_card(PRIOR_ALONE, **OPEN_GATES, side_gates=sides) for sides in (True, None))
    return [refine(Mesh(points, faces), pns(model)).mesh.vertices for model in models]


def prism(sides):
    """A regular prism: two rings of vertices, then the lids' middles."""
    angle, j = 2 * np.pi * np.arange(sides) / sides, np.arange(sides)
    ring, after = np.stack([np.cos(angle), np.sin(angle)], axis=1), (j + 1) % sides
    low, high, middle = np.c_[ring, 0 * angle], np.c_[ring, 0 * angle + 2], 2 * sides + 0 * j
    walls = [np.c_[j, after, after + sides], np.c_[j, after + sides, j + sides]]
    lids = [np.c_[after, j, middle], np.c_[j + sides, after + sides, middle + 1]]
    points = np.concatenate([low, high, [[0, 0, 0], [0, 0, 2]]])
    return points, np.concatenate(walls + lids)


def box_of_quads(side):
    """A cube with so many quads along each edge, each cut in two."""
    line = np.arange(side + 1)
    u, v = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    flat, zero, full = np.arange(len(u)).reshape(side + 1, -1), 0 * u, 0 * u + side
    corners = flat[:-1, :-1], flat[1:, :-1], flat[1:, 1:], flat[:-1, 1:]
    quads = np.stack([corner.ravel() for corner in corners], axis=1)
    sheets, faces = [], []
    for columns in ((u, v, full), (v, full, u), (full, u, v)):
        sheets.append(np.stack(columns, axis=1))
        faces.append(quads)
    for columns in ((u, v, zero), (v, zero, u), (zero, u, v)):
        sheets.append(np.stack(columns, axis=1))
        faces.append(quads[:, ::-1])
    points = np.concatenate(sheets).astype(float)
    every = np.concatenate([sheet + k * len(u) for k, sheet in enumerate(faces)])
    points, number = np.unique(points, axis=0, return_inverse=True)
    return points, number.reshape(-1)[every][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


OPEN_GATES = {"gate_sharpness": 1e12, "vertex_gate_sharpness": 1e9, "budget": 1e6}


def torus_of_quads(around, across):
    """Its quads are plane, and all cut the same way."""
    u, v = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (around, across)), indexing="ij")
    radius = 1 + 0.4 * np.cos(v)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=-1)
    i, j = (axis.ravel() for axis in np.mgrid[:around, :across])
    next_i, next_j = (i + 1) % around, (j + 1) % across
    a, b, c, d = i * across + j, next_i * across + j, next_i * across + next_j, i * across + next_j
    return points.reshape(-1, 3), np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)


def quasi_interpolated(points, faces):
    """Push every vertex along its normal by as much as Loop's limit takes it in, then Loop."""
    topology = build_topology(faces, len(points))
    pushed = points.copy()
    for v in range(len(points)):
        ring = np.unique(topology.edges[(topology.edges == v).any(axis=1)])
        ring = ring[ring != v]
        k = len(ring)
        beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
        limit = (points[v] * 3 / (8 * beta) + points[ring].sum(axis=0)) / (3 / (8 * beta) + k)
        around = faces[(faces == v).any(axis=1)]
        u, w = (
            points[around[:, 1]] - points[around[:, 0]],
            points[around[:, 2]] - points[around[:, 0]],
        )
        normal = np.cross(u, w).sum(axis=0)
        normal /= np.linalg.norm(normal)
        pushed[v] += (points[v] - limit) @ normal * normal
    return refine_linear(pushed, [topology])


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
    rng = np.random.default_rng(seed)
    vertices, faces = grid(5)
    vertices[:, :2] += rng.uniform(-0.1, 0.1, (len(vertices), 2))
    mesh = Mesh(vertices @ rotation(rng).T, faces)
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
    assert torch.autograd.gradcheck(lambda p: step_on(mesh, torch, p).points, (points,))


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


def test_older_formats_have_no_scale_free_numbers():
    assert scale_free_form(vertex_model().card, 1.0) is None


def test_a_card_of_format_3_needs_a_vertex_network():
    class Without:
        name, hash, card = "without", "0" * 64, SCALE_FREE_CARD

        def __call__(self, features, budget):
            return np.zeros((len(features), 3))

    with pytest.raises(ModelError, match="vertex network"):
        pns(Without())
