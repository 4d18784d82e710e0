"""Distances between meshes as surfaces."""

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.meshes import bumpy_sphere, grid, icosphere, rotation
from train.metrics.surface_distance import (
    prepared,
    surface_errors,
)


def errors(true, refined, samples=2000):
    return surface_errors(prepared(true, samples), prepared(refined, samples))


def moved(mesh, offset):
    return Mesh(mesh.vertices + np.array(offset), mesh.faces)


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
