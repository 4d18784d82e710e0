"""Surfaces that data is made of."""

import numpy as np
import pytest
import torch
from train.data.patches import rounded_boxes, tori
from train.surfaces.cad import Fillet, RoundedBox, Torus

from train.surfaces.implicit import Ridge, Saddle, SphereRidge, signed_distance, unit_normal
from train.surfaces.smooth import Bump, Crossing, CurvedRidge, LumpySphere

EXACT = {"torus": Torus(1.0, 0.3), "box": RoundedBox(0.4), "fillet": Fillet(0.3)}
each_exact = pytest.mark.parametrize("name", EXACT)


def points_for(count=200):
    return np.random.default_rng(5).uniform(-0.8, 1.2, (count, 3))


@each_exact
def test_gradient_is_the_derivative_and_has_length_one(name):
    points = torch.tensor(points_for(), requires_grad=True)
    surface = EXACT[name]
    (expected,) = torch.autograd.grad(surface.value(points).sum(), points)
    gradient = surface.gradient(points.detach())
    torch.testing.assert_close(gradient, expected, rtol=0, atol=1e-12)
    torch.testing.assert_close(gradient.norm(dim=1), torch.ones(len(gradient), dtype=torch.float64))


@each_exact
def test_a_step_of_the_distance_along_the_gradient_lands_on_the_surface(name):
    surface, points = EXACT[name], points_for()
    landed = points - surface.value(points)[:, None] * surface.gradient(points)
    near = np.abs(surface.value(points)) < 0.15
    np.testing.assert_allclose(surface.value(landed)[near], 0, atol=1e-12)


def test_known_distances():
    torus = np.array([[1.3, 0, 0], [0, 0, 0], [2.0, 0, 0], [0, 1.0, 0.5]])
    np.testing.assert_allclose(Torus(1.0, 0.3).value(torus), [0, 0.7, 0.7, 0.2], atol=1e-15)
    box = np.array([[-0.4, -0.4, 0], [-1, -1, 0.5], [-0.4, -0.4, -0.4], [0, 0, 0]])
    expected = [0, 0.5, -0.4, 0.4 * (3**0.5 - 1)]
    np.testing.assert_allclose(RoundedBox(0.4).value(box), expected, atol=1e-15)
    fillet = np.array([[5, 1, 0], [5, 1, 0.2], [0, 0, 0], [0, 1, -0.1]])
    expected = [0, 0.2, 0.3 - 0.3 * 2**0.5, -0.1]
    np.testing.assert_allclose(Fillet(0.3).value(fillet), expected, atol=1e-15)


@pytest.mark.parametrize("family", [tori, rounded_boxes])
def test_patches_lie_on_their_surface_and_look_outwards(family):
    for instance in family().instances:
        vertices, faces = instance.mesh.vertices, instance.mesh.faces
        assert np.abs(instance.surface.value(vertices)).max() < 1e-12
        a, b, c = vertices[faces].transpose(1, 0, 2)
        outward = instance.surface.gradient((a + b + c) / 3)
        assert (np.sum(np.cross(b - a, c - a) * outward, axis=1) > 0).all()
        assert instance.surface.feature_distance(vertices).min() < 0.3


SURFACES = [
    Ridge(amplitude=0.6, sharpness=7.0, angle=0.7, centre_x=0.05, centre_y=-0.02),
    Saddle(amplitude=0.5, centre_x=0.05, centre_y=-0.02),
    SphereRidge(radius=1.0, amplitude=0.1, sharpness=30.0, angle=2.9),
    CurvedRidge(amplitude=0.5, sharpness=6.0, radius=0.9, centre_x=-0.3, centre_y=0.1),
    Crossing(0.5, 6.0, 0.4, 0.3, 4.0, 1.7),
    Bump(amplitude=0.5, sharpness=4.0, elongation=0.3, angle=0.8, centre_x=0.4, centre_y=0.3),
    LumpySphere(0.8, amplitude=0.1, frequency=4.0, phase_x=0.3, phase_y=1.1, phase_z=2.0),
]
BY_NAME = [pytest.param(surface, id=type(surface).__name__) for surface in SURFACES]


def sample_points():
    return np.random.default_rng(0).uniform(0.2, 0.9, size=(50, 3))


@pytest.mark.parametrize("surface", BY_NAME)
def test_gradient_is_the_derivative_of_value(surface):
    points = torch.from_numpy(sample_points()).requires_grad_()
    (expected,) = torch.autograd.grad(surface.value(points).sum(), points)
    np.testing.assert_allclose(surface.gradient(points.detach()), expected, atol=1e-13)


@pytest.mark.parametrize("surface", BY_NAME)
def test_distance_is_right_to_first_order(surface):
    points = sample_points()
    # Newton steps along the gradient reach the surface; then step off it by a known length.
    for _ in range(50):
        gradient = surface.gradient(points)
        points = points - (surface.value(points) / (gradient**2).sum(-1))[:, None] * gradient
    np.testing.assert_allclose(surface.value(points), 0, atol=1e-12)
    away = points + 1e-5 * unit_normal(surface, points)
    np.testing.assert_allclose(signed_distance(surface, away), 1e-5, rtol=2e-3)
