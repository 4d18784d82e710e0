"""Baselines and controls are what their sources define, on any mesh."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from pns_common import Mesh, loop
from tests.support.meshes import bumpy_sphere, grid, manifolds, rotation, soups
from train.baselines.butterfly import butterfly_edge_vertices, modified_butterfly, star_weights
from train.baselines.controls import flat, full_push, n1, nc, q1
from train.baselines.edge_rules import curvature_adaptive, fit_scalar, normal_displacement
from train.baselines.neural_subdivision import HalfFlapNets, neural_subdivision
from train.baselines.pn_triangles import cubic_control_point, pn_triangles
from train.baselines.quadric import quadric_edge_points, quadric_fit
from train.connectivity import connect
from train.data.datasets import Dataset, Instance, ridge_training
from train.data.primitives import box, globe, icosphere, torus
from train.metrics.card import one_step_table
from train.refining import refine
from train.surfaces.implicit import SphereRidge

BASELINES = {
    "butterfly": modified_butterfly(),
    "pn-triangles": pn_triangles(),
    "quadric": quadric_fit(),
    "normal-displacement": normal_displacement(0.05),
    "curvature-adaptive": curvature_adaptive(10.0),
}
# Its trained networks, and others.
HALF_FLAPS = {
    "neural-subdivision": neural_subdivision(),
    "neural-subdivision, untrained": neural_subdivision(HalfFlapNets(torch.Generator())),
}
BASELINES |= HALF_FLAPS
SHAPES = {"torus": torus(7, 5), "globe": globe(9, 4), "box": box(1, 2, 3)}
each_baseline = pytest.mark.parametrize("name", BASELINES)


@each_baseline
@settings(max_examples=10)
@given(mesh=soups())
def test_any_mesh_is_refined_to_finite_points(name, mesh):
    refined = refine(mesh, BASELINES[name], levels=2).mesh
    assert np.isfinite(refined.vertices).all()
    assert len(refined.faces) == 16 * len(mesh.faces)


@each_baseline
@settings(max_examples=10)
@given(mesh=manifolds())
def test_baselines_commute_with_rigid_motion(name, mesh):
    turn, shift = rotation(np.random.default_rng(3)), np.array([3.0, -1.0, 0.5])
    moved = Mesh(mesh.vertices @ turn.T + shift, mesh.faces)
    here, there = (refine(each, BASELINES[name]).mesh.vertices for each in (mesh, moved))
    np.testing.assert_allclose(there, here @ turn.T + shift, atol=1e-6)


def butterfly(mesh):
    level = connect(mesh.faces, len(mesh.vertices))
    placed = butterfly_edge_vertices(torch.tensor(mesh.vertices), level).numpy()
    return placed, mesh.vertices[level.edges].mean(axis=1), level


def cubic(x, y):
    return 1 + x - 2 * y + x * x - x * y + 3 * y * y + x**3 - 2 * x * x * y + x * y * y - 0.5 * y**3


def test_butterfly_reproduces_cubics_on_the_regular_grid_and_no_quartics():
    for height, reproduced in ((cubic, True), (lambda x, y: x**4, False)):
        placed, middle, _ = butterfly(Mesh(*grid(9, height)))
        inside = (np.abs(middle[:, :2]) < 0.6).all(axis=1)
        off = np.abs(placed[inside, 2] - height(*middle[inside, :2].T)).max()
        assert (off < 1e-13) == reproduced


def star(valence, height):
    """A fan round vertex 0, its rim of valence 6, so that one end alone is extraordinary."""
    angle, wide = (2 * np.pi * np.arange(n) / n for n in (valence, 2 * valence))
    rim = np.stack([np.cos(angle), np.sin(angle), height(angle)], axis=1)
    outer = 2 * np.stack([np.cos(wide), np.sin(wide), 0 * wide], axis=1)
    j = np.arange(valence)
    inner, following, first = 1 + j, 1 + (j + 1) % valence, 1 + valence
    opposite, between, after = first + 2 * j, first + 2 * j + 1, first + (2 * j + 2) % (2 * valence)
    faces = [(0 * j, inner, following), (inner, opposite, between)]
    faces += [(inner, between, following), (following, between, after)]
    vertices = np.concatenate([np.zeros((1, 3)), rim, outer])
    return Mesh(vertices, np.concatenate([np.stack(face, axis=1) for face in faces]))


@pytest.mark.parametrize("valence", [3, 4, 5, 7, 8, 12])
def test_butterflys_star_rule_has_the_eigenvalues_of_a_smooth_limit(valence):
    """Zorin's construction: first harmonics shrink by 1/2, second harmonics by 1/4."""
    for frequency, factor in ((1, 1 / 2), (2, 1 / 4)):
        if frequency == 2 and valence < 4:
            continue
        mesh = star(valence, lambda angle, f=frequency: np.cos(f * angle))
        placed, _, level = butterfly(mesh)
        spokes = np.flatnonzero(level.edges[:, 0] == 0)
        rim = mesh.vertices[level.edges[spokes, 1]]
        np.testing.assert_allclose(placed[spokes, :2], rim[:, :2] / 2, atol=1e-14)
        np.testing.assert_allclose(placed[spokes, 2], factor * rim[:, 2], atol=1e-14)
    weights = [star_weights(np.array([valence]), turn)[0] for turn in range(valence)]
    assert sum(weights) == pytest.approx(1 / 4)


def test_pn_triangles_interpolate_a_circle_to_fourth_order():
    """On a circular arc the cubic's middle misses the circle by the fourth power of the angle."""

    def missed(angle):
        ends = torch.tensor([[[1.0, 0, 0]], [[np.cos(angle), np.sin(angle), 0]]]).double()
        near = cubic_control_point(ends[0], ends[1], ends[0])
        far = cubic_control_point(ends[1], ends[0], ends[1])
        return abs(np.linalg.norm((ends[0] + 3 * near + 3 * far + ends[1]) / 8) - 1)

    assert missed(0.4) / missed(0.2) == pytest.approx(16, rel=0.1)


def test_the_quadric_is_exact_on_height_quadratics_along_its_axis():
    vertices, faces = grid(6, lambda x, y: 0.3 * x * x - 0.2 * x * y + 0.1 * y * y + x)
    level = connect(faces, len(vertices))
    axes = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    placed = quadric_edge_points(vertices, level.edges.numpy(), axes)
    inner = (np.abs(vertices[level.edges][..., :2]) < 0.9).all(axis=(1, 2))
    x, y = placed[inner, 0], placed[inner, 1]
    np.testing.assert_allclose(
        placed[inner, 2], 0.3 * x * x - 0.2 * x * y + 0.1 * y * y + x, atol=1e-12
    )


@pytest.mark.parametrize("name", SHAPES)
def test_controls_push_by_what_the_limit_takes_and_are_loop_afterwards(name):
    mesh = SHAPES[name]
    points, level = torch.tensor(mesh.vertices), connect(mesh.faces, len(mesh.vertices))
    deep = refine(mesh, loop(), 6).mesh.vertices[: len(mesh.vertices)]
    push = full_push(points, level).numpy()
    np.testing.assert_allclose(mesh.vertices - push, deep, atol=3e-4 * np.ptp(mesh.vertices))
    expected = refine(Mesh(mesh.vertices + push, mesh.faces), loop(), 3).mesh
    np.testing.assert_allclose(refine(mesh, q1(), 3).mesh.vertices, expected.vertices, atol=1e-13)
    ends = mesh.vertices[level.edges]
    flattened = refine(mesh, flat()).mesh.vertices
    np.testing.assert_allclose(flattened[len(points) :], ends.mean(axis=1), atol=1e-15)


def test_n1_holds_a_sphere_that_loop_shrinks():
    sphere = icosphere(1)
    radius = [
        np.linalg.norm(refine(sphere, scheme, 3).mesh.vertices, axis=1).mean()
        for scheme in (loop(), nc(), n1())
    ]
    assert radius[0] < radius[1] < radius[2]
    assert abs(radius[2] - 1) < 0.2 * abs(radius[0] - 1)


def test_nc_is_loop_on_a_plane_and_stays_within_its_budget():
    plane = Mesh(*grid(4))
    np.testing.assert_allclose(
        refine(plane, nc(), 2).mesh.vertices, refine(plane, loop(), 2).mesh.vertices, atol=1e-15
    )
    mesh = Mesh(*bumpy_sphere())
    made, base = (refine(mesh, scheme, 1, 50.0).mesh.vertices for scheme in (nc(), loop()))
    ends = mesh.vertices[connect(mesh.faces, len(mesh.vertices)).edges]
    square = ((ends[:, 0] - ends[:, 1]) ** 2).sum(axis=1)
    away = np.linalg.norm(made - base, axis=1)[len(mesh.vertices) :]
    assert (away <= 0.8 / 50 * square * (1 + 1e-12)).all()
    assert away.max() > 0.5 * 0.8 / 50 * square.max()


def test_butterfly_reproduces_cubics_along_a_boundary():
    placed, middle, level = butterfly(Mesh(*grid(9, lambda x, y: y**3 - y)))
    # At a corner of the grid the curve turns, so the last edges are left out.
    side = level.boundary.numpy() & (np.abs(middle[:, 0]) == 1) & (np.abs(middle[:, 1]) < 0.8)
    assert side.sum() == 12
    np.testing.assert_allclose(placed[side, 2], middle[side, 1] ** 3 - middle[side, 1], atol=1e-14)


def test_the_fitted_scalar_reaches_a_sphere_and_is_better_than_its_neighbours():
    mesh = icosphere(0)
    edge = np.linalg.norm(mesh.vertices[mesh.faces[0, 0]] - mesh.vertices[mesh.faces[0, 1]])
    data = Dataset("icosahedron", (Instance(SphereRidge(1.0, 0.0, 1.0, 0.0), mesh),))
    # Loop's edge vertices all have one radius: its masks know the icosahedron's symmetry.
    radius = np.linalg.norm(refine(mesh, loop()).mesh.vertices[12:], axis=1)
    assert fit_scalar(data) == pytest.approx((1 - radius[0]) / edge)
    few = Dataset("few", ridge_training().instances[:4])
    scalar = fit_scalar(few)
    sums = [
        (one_step_table(normal_displacement(scalar + off), few)["distance"] ** 2).sum()
        for off in (0, -0.01, 0.01)
    ]
    assert sums[0] < min(sums[1:])
