"""Distances between meshes as surfaces."""

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.meshes import bumpy_sphere, grid, icosphere, rotation
from train.metrics.surface_distance import (
    SURFACE_METRICS,
    prepared,
    surface_errors,
    surface_samples,
)


def errors(true, refined, samples=2000):
    return surface_errors(prepared(true, samples), prepared(refined, samples))


def moved(mesh, offset):
    return Mesh(mesh.vertices + np.array(offset), mesh.faces)


def test_a_surface_is_no_distance_from_itself():
    mesh = Mesh(*bumpy_sphere())
    same = errors(mesh, mesh)
    for metric in SURFACE_METRICS:
        assert getattr(same, metric) == pytest.approx(0, abs=1e-6)


def test_parallel_planes_are_their_gap_apart():
    plane = Mesh(*grid(5))
    apart = errors(plane, moved(plane, (0, 0, 0.25)))
    for metric in ("mean", "p95", "hausdorff"):
        assert getattr(apart, metric) == pytest.approx(0.25 / 8**0.5, rel=1e-12)
    assert apart.normal == pytest.approx(0, abs=1e-12)


def test_both_ways_are_seen():
    """Half a plane lies in the whole one; the whole one's far side is one length away from it."""
    whole = Mesh(*grid(9))
    half = Mesh(whole.vertices * [0.5, 1, 1] - [0.5, 0, 0], whole.faces)
    for true, refined in ((whole, half), (half, whole)):
        measured = errors(true, refined, samples=20_000)
        diagonal = np.linalg.norm(np.ptp(true.vertices, axis=0))
        # One way nothing; the other way 0 on one half, evenly 0 … 1 on the other.
        assert measured.mean == pytest.approx((0 + 0.25) / 2 / diagonal, rel=1e-3)
        assert measured.p95 == pytest.approx((0 + 0.9) / 2 / diagonal, rel=5e-3)
        assert measured.hausdorff == pytest.approx(1 / diagonal, rel=1e-12)


def test_concentric_spheres_are_the_difference_of_their_radii_apart():
    apart = errors(Mesh(*icosphere(4)), Mesh(*icosphere(4, radius=1.1)))
    assert apart.mean == pytest.approx(0.1 / 12**0.5, rel=5e-3)
    assert apart.hausdorff == pytest.approx(0.1 / 12**0.5, rel=1e-2)


def test_the_normal_error_is_the_angle_between_tilted_planes():
    plane, angle = Mesh(*grid(5)), 0.2
    c, s = np.cos(angle), np.sin(angle)
    tilted = Mesh(plane.vertices @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]), plane.faces)
    assert errors(plane, tilted).normal == pytest.approx(angle, rel=1e-12)


def test_errors_do_not_change_with_place_and_size():
    true, refined = Mesh(*icosphere(2)), Mesh(*bumpy_sphere(subdivisions=2))
    turn, before = rotation(np.random.default_rng(0)), errors(true, refined)

    def placed(mesh):
        return Mesh(40 * mesh.vertices @ turn.T, mesh.faces)

    after = errors(placed(true), placed(refined))
    # The bounding box does not turn with the mesh: compare in its units.
    unit = np.linalg.norm(np.ptp(placed(true).vertices, axis=0)) / 40
    unit /= np.linalg.norm(np.ptp(true.vertices, axis=0))
    for metric in ("mean", "p95", "hausdorff"):
        assert getattr(after, metric) * unit == pytest.approx(getattr(before, metric), rel=1e-9)
    # Where the nearest point is on an edge, rounding chooses the face.
    assert after.normal == pytest.approx(before.normal, rel=1e-2)


def test_samples_lie_in_their_faces_evenly_by_area():
    mesh = Mesh(*bumpy_sphere())
    points, faces = surface_samples(mesh, 5000, np.random.default_rng(0))
    corners = mesh.vertices[mesh.faces]
    weights = np.linalg.solve(corners[faces].swapaxes(1, 2), points[..., None])[..., 0]
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-9)
    assert weights.min() > -1e-9
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    counts = np.bincount(faces, minlength=len(corners))
    # Stratified: a piece that only partly lies in a face may fall on either side of its ends.
    assert np.abs(counts - 5000 * area / area.sum()).max() < 2


def test_samples_are_even_within_a_face():
    points, _ = surface_samples(
        Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), 40_000, np.random.default_rng(0)
    )
    np.testing.assert_allclose(points.mean(axis=0), [1 / 3, 1 / 3, 0], atol=5e-3)
    np.testing.assert_allclose(points[:, :2].var(axis=0), 1 / 18, atol=1e-3)


def test_faces_without_area_get_no_samples():
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 1, 3], [0, 1, 2], [0, 1, 3]])
    _, faces = surface_samples(mesh, 200, np.random.default_rng(0))
    assert (faces == 1).all()


def test_the_same_mesh_gives_the_same_samples():
    mesh = Mesh(*bumpy_sphere())
    np.testing.assert_array_equal(prepared(mesh, 100).points, prepared(mesh, 100).points)
