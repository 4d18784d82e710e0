"""Baselines and controls are what their sources define, on any mesh."""

import numpy as np
import pytest
import torch
import trimesh
from hypothesis import given, settings

from pns_common import Mesh, loop
from pns_common.kernels.connectivity import BOUNDARY
from pns_common.operator.level import Level
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from tests.support.meshes import grid, icosphere, manifolds, rotation, soups
from train.baselines.butterfly import butterfly_edge_vertices, modified_butterfly, star_weights
from train.baselines.controls import flat, n1
from train.baselines.edge_rules import curvature_adaptive, fit_scalar, normal_displacement
from train.baselines.neural_subdivision import HalfFlapNets, neural_subdivision
from train.baselines.pn_triangles import cubic_control_point, pn_triangles
from train.baselines.quadric import quadric_edge_points, quadric_fit
from train.data.datasets import Dataset, Instance, ridge_training
from train.metrics.card import one_step_table
from train.refining import refine
from train.surfaces.implicit import SphereRidge

BASELINES = {
    "butterfly": modified_butterfly(),
    "pn-triangles": pn_triangles(),
    "quadric": quadric_fit(),
    "normal-displacement": normal_displacement(0.05),
    "curvature-adaptive": curvature_adaptive(10.0),
    "neural-subdivision": neural_subdivision(),
    "neural-subdivision, untrained": neural_subdivision(HalfFlapNets(torch.Generator())),
}
each_baseline = pytest.mark.parametrize("name", BASELINES)


def level_of(mesh):
    return Level(mesh.vertices, mesh.topology(), LOOP, 1.0, Blocks())


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
    """New vertices, and the ends of their edges."""
    return butterfly_edge_vertices(level_of(mesh)), mesh.topology().edges.astype(int)


def cubic(x, y):
    return 1 + x - 2 * y + x * x - x * y + 3 * y * y + x**3 - 2 * x * x * y + x * y * y - 0.5 * y**3


def test_butterfly_reproduces_cubics_on_the_regular_grid_and_no_quartics():
    for height, reproduced in ((cubic, True), (lambda x, y: x**4, False)):
        mesh = Mesh(*grid(9, height))
        placed, ends = butterfly(mesh)
        middle = mesh.vertices[ends].mean(axis=1)
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
        placed, ends = butterfly(mesh)
        spokes = np.flatnonzero(ends[:, 0] == 0)
        rim = mesh.vertices[ends[spokes, 1]]
        np.testing.assert_allclose(placed[spokes, :2], rim[:, :2] / 2, atol=1e-14)
        np.testing.assert_allclose(placed[spokes, 2], factor * rim[:, 2], atol=1e-14)
    weights = [star_weights(np.array([valence]), turn)[0] for turn in range(valence)]
    assert sum(weights) == pytest.approx(1 / 4)


def test_pn_triangles_interpolate_a_circle_to_fourth_order():
    """On a circular arc the cubic's middle misses the circle by the fourth power of the angle."""

    def missed(angle):
        ends = np.array([[[1.0, 0, 0]], [[np.cos(angle), np.sin(angle), 0]]])
        near = cubic_control_point(ends[0], ends[1], ends[0])
        far = cubic_control_point(ends[1], ends[0], ends[1])
        return abs(np.linalg.norm((ends[0] + 3 * near + 3 * far + ends[1]) / 8) - 1)

    assert missed(0.4) / missed(0.2) == pytest.approx(16, rel=0.1)


def test_the_quadric_is_exact_on_height_quadratics_along_its_axis():
    vertices, faces = grid(6, lambda x, y: 0.3 * x * x - 0.2 * x * y + 0.1 * y * y + x)
    ends = Mesh(vertices, faces).topology().edges.astype(int)
    axes = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    placed = quadric_edge_points(vertices, ends, axes)
    inner = (np.abs(vertices[ends][..., :2]) < 0.9).all(axis=(1, 2))
    x, y = placed[inner, 0], placed[inner, 1]
    np.testing.assert_allclose(
        placed[inner, 2], 0.3 * x * x - 0.2 * x * y + 0.1 * y * y + x, atol=1e-12
    )


def test_n1_pushes_by_what_the_limit_takes_along_the_normal_once_and_flat_stays():
    torus = trimesh.creation.torus(1, 0.4, 9, 7)
    mesh = Mesh(torus.vertices, torus.faces)
    deep = refine(mesh, loop(), 6).mesh.vertices[: len(mesh.vertices)]
    corners = mesh.vertices[mesh.faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(mesh.vertices)
    np.add.at(normals, mesh.faces.reshape(-1), np.repeat(areas, 3, axis=0))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    push = ((mesh.vertices - deep) * normals).sum(axis=1, keepdims=True) * normals
    pushed = refine(Mesh(mesh.vertices + push, mesh.faces), loop(), 3).mesh.vertices
    np.testing.assert_allclose(refine(mesh, n1(), 3).mesh.vertices, pushed, atol=1e-3)
    flattened = refine(mesh, flat()).mesh.vertices
    ends = mesh.vertices[mesh.topology().edges.astype(int)]
    np.testing.assert_array_equal(flattened[: len(mesh.vertices)], mesh.vertices)
    np.testing.assert_allclose(flattened[len(mesh.vertices) :], ends.mean(axis=1), atol=1e-15)


def test_butterfly_reproduces_cubics_along_a_boundary():
    mesh = Mesh(*grid(9, lambda x, y: y**3 - y))
    placed, ends = butterfly(mesh)
    middle = mesh.vertices[ends].mean(axis=1)
    # At a corner of the grid the curve turns, so the last edges are left out.
    side = (
        (mesh.topology().edge_class == BOUNDARY)
        & (np.abs(middle[:, 0]) == 1)
        & (np.abs(middle[:, 1]) < 0.8)
    )
    assert side.sum() == 12
    np.testing.assert_allclose(placed[side, 2], middle[side, 1] ** 3 - middle[side, 1], atol=1e-14)


def test_the_fitted_scalar_reaches_a_sphere_and_is_better_than_its_neighbours():
    mesh = Mesh(*icosphere(0))
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
