import numpy as np
import pytest

from pns_common import Mesh, loop, refine
from tests.support.meshes import grid, icosphere
from train.data.datasets import ridge_held_out
from train.metrics.shape import (
    distance_level,
    face_normal_error,
    level_errors,
    nearest_points,
    shape_errors,
)
from train.surfaces.implicit import Ridge, Saddle, SphereRidge, unit_normal

SPHERE = SphereRidge(1.0, 0.0, 1.0, 0.0)


def test_nearest_points_of_a_sphere_are_along_the_radius():
    rng = np.random.default_rng(0)
    points = rng.standard_normal((50, 3)) * [1, 1, 0.3]
    expected = points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(nearest_points(SPHERE, points), expected, atol=1e-12)


def test_nearest_points_of_a_ridge_are_as_near_as_a_dense_search_finds():
    instance = ridge_held_out().instances[8]
    ridge = instance.surface
    points = refine(instance.mesh, loop(), 1, reference_length=1.0).mesh.vertices[:40]
    distances = np.linalg.norm(points - nearest_points(ridge, points), axis=1)
    # The ridge is a cylinder over its section, so the search is in the plane (y', z).
    y = np.linspace(-2, 2, 200_001)
    z = ridge.amplitude * np.exp(-ridge.sharpness * y**2)
    across = ridge.across(points)
    dense = [np.hypot(y - a, z - h).min() for a, h in zip(across, points[:, 2], strict=True)]
    np.testing.assert_allclose(distances, dense, atol=1e-5)


@pytest.mark.parametrize("share", [-0.7, -0.5, 0.3, 0.6])
def test_nearest_points_are_found_up_to_where_they_meet(share):
    """On the normal at a crest, at a share of the radius of curvature there, inside or outside."""
    ridge = Ridge(0.5, 8.0, 0.0, 0.0, 0.0)
    radius = 1 / (2 * ridge.sharpness * ridge.amplitude)
    points = np.array([[x, 1e-4, ridge.amplitude + share * radius] for x in (-0.3, 0.4)])
    found = nearest_points(ridge, points)
    normal = unit_normal(ridge, found)
    away = points - found
    aside = away - (away * normal).sum(axis=1)[:, None] * normal
    np.testing.assert_allclose(aside, 0, atol=1e-9)
    assert np.linalg.norm(away, axis=1) == pytest.approx(abs(share) * radius, rel=1e-4)


def test_a_plane_of_the_wrong_tilt_has_its_tilt_as_normal_error():
    vertices, faces = grid(4, lambda x, y: 0.1 * x)
    error = face_normal_error(Saddle(0.0, 0.0, 0.0), Mesh(vertices, faces))
    np.testing.assert_allclose(error, np.arctan(0.1), atol=1e-12)


def test_errors_of_an_icosphere_against_its_sphere():
    errors = shape_errors(SPHERE, Mesh(*icosphere(2)))
    assert errors.distance < 1e-15
    assert errors.hausdorff < 1e-15
    # A face's normal is that of its circumcentre, near its centroid.
    assert errors.normal_max < 0.02
    assert 0 < errors.normal_mean <= errors.normal_max


def test_a_shifted_sphere_is_off_by_the_shift():
    vertices, faces = icosphere(2)
    errors = shape_errors(SPHERE, Mesh(1.1 * vertices, faces))
    assert errors.distance == pytest.approx(0.1)
    assert errors.hausdorff == pytest.approx(0.1)
    assert errors.normal_max < 0.02


def test_faces_without_area_are_left_out():
    vertices, faces = icosphere(0)
    flat = Mesh(vertices, np.concatenate([faces, [[0, 0, 1]]]))
    assert len(face_normal_error(SPHERE, flat)) == len(faces)


def test_a_level_has_the_report_beside_its_errors():
    instance = ridge_held_out().instances[0]
    refinement = refine(instance.mesh, loop(), levels=2, reference_length=1.0)
    errors = level_errors(instance.surface, refinement, 2)
    report = refinement.report["levels"][-1]
    assert errors.faces == report["faces"] == 16 * 128
    assert errors.normal_jump == report["normal_jump_max"]
    assert errors.ratio == errors.flipped == 0
    assert errors.level == 2
    cheap = distance_level(instance.surface, refinement)
    assert (cheap.distance, cheap.hausdorff) == (errors.shape.distance, errors.shape.hausdorff)
    assert (cheap.faces, cheap.jump, cheap.ratio) == (errors.faces, errors.normal_jump, 0)
