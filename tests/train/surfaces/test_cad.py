import numpy as np
import pytest
import torch

from train.data.patches import fillets, rounded_boxes, tori
from train.surfaces.cad import Fillet, RoundedBox, Torus

SURFACES = {"torus": Torus(1.0, 0.3), "box": RoundedBox(0.4), "fillet": Fillet(0.3)}
each_surface = pytest.mark.parametrize("name", SURFACES)


def points_for(count=200):
    return np.random.default_rng(5).uniform(-0.8, 1.2, (count, 3))


@each_surface
def test_gradient_is_the_derivative_and_has_length_one(name):
    points = torch.tensor(points_for(), requires_grad=True)
    surface = SURFACES[name]
    (expected,) = torch.autograd.grad(surface.value(points).sum(), points)
    gradient = surface.gradient(points.detach())
    torch.testing.assert_close(gradient, expected, rtol=0, atol=1e-12)
    torch.testing.assert_close(gradient.norm(dim=1), torch.ones(len(gradient), dtype=torch.float64))


@each_surface
def test_a_step_of_the_distance_along_the_gradient_lands_on_the_surface(name):
    surface, points = SURFACES[name], points_for()
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


@pytest.mark.parametrize("family", [fillets, tori, rounded_boxes])
def test_patches_lie_on_their_surface_and_look_outwards(family):
    for instance in family().instances:
        vertices, faces = instance.mesh.vertices, instance.mesh.faces
        assert np.abs(instance.surface.value(vertices)).max() < 1e-12
        a, b, c = vertices[faces].transpose(1, 0, 2)
        outward = instance.surface.gradient((a + b + c) / 3)
        assert (np.sum(np.cross(b - a, c - a) * outward, axis=1) > 0).all()
        assert instance.surface.feature_distance(vertices).min() < 0.3
