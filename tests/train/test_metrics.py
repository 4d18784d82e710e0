"""Measures: the published one-step ones, the envelope's limit, whole surfaces and their bending."""

import numpy as np
import pytest

from pns_common import Mesh, loop, pns
from tests.support.networks import random_model
from train.connectivity import connect
from train.data.datasets import Dataset, ridge_held_out, saddle_held_out, sphere_ridge_held_out
from train.data.primitives import icosphere, torus
from train.metrics.card import one_step_table
from train.metrics.envelope import envelope_limit, oracle
from train.metrics.one_step import (
    fan_normal,
    improvement,
    one_step_errors,
)
from train.metrics.shape import (
    bending,
    nearest_points,
    shape_errors,
)
from train.metrics.whole_surface import normal_jump
from train.refining import refine
from train.surfaces.implicit import Ridge, SphereRidge, unit_normal


def test_points_on_a_sphere_have_no_distance_error():
    sphere = SphereRidge(1.0, 0.0, 1.0, 0.0)
    mesh = sphere_ridge_held_out().instances[0].mesh
    level = connect(mesh.faces, len(mesh.vertices))
    inserted = mesh.vertices[level.edges[level.interior]].mean(axis=1)
    inserted /= np.linalg.norm(inserted, axis=1, keepdims=True)
    errors = one_step_errors(sphere, mesh.vertices, level, inserted)
    assert errors.distance < 1e-15
    assert errors.hausdorff < 1e-15
    shifted = one_step_errors(sphere, mesh.vertices, level, 1.25 * inserted)
    assert shifted.distance == pytest.approx(0.25)
    assert shifted.hausdorff == pytest.approx(0.25)


def two_triangles():
    """Edge (0, 1) with c = 2 on its left and d = 3 on its right, in space."""
    coarse = np.array([[0, 0, 0], [1, 0, 0.2], [0.4, 0.9, 0.3], [0.6, -0.8, 0.1]])
    return coarse, connect(np.array([[0, 1, 2], [1, 0, 3]]), 4)


def test_fan_normal_does_not_depend_on_an_inserted_vertex_that_folds_nothing():
    coarse, level = two_triangles()
    a, b, c, d = coarse
    expected = np.cross(b - a, c - d)
    for offset in (0.0, 0.05, -0.05):
        inserted = np.array([[0.5, 0.0, 0.1 + offset]])
        normal = fan_normal(coarse, level, inserted)
        np.testing.assert_allclose(normal, expected[None], rtol=0, atol=1e-15)


def test_fan_normal_turns_a_folded_triangle_back():
    coarse, level = two_triangles()
    a, b, c, d = coarse
    inserted = np.array([[-0.5, 0.6, 0.1]])
    q = inserted[0]
    n1, n2 = np.cross(b - a, c - a), np.cross(a - b, d - b)
    sides = [(a, c, n1), (c, b, n1), (b, d, n2), (d, a, n2)]
    areas = [np.cross(u - q, v - q) for u, v, _ in sides]
    turned = [area * np.sign(area @ n) for area, (_, _, n) in zip(areas, sides, strict=True)]
    assert np.abs(sum(turned)).sum() > np.abs(sum(areas)).sum() + 0.1
    # The four run a → c → b → d round q: against the faces, so that all are turned.
    np.testing.assert_allclose(fan_normal(coarse, level, inserted)[0], sum(turned), atol=1e-15)


def test_bootstrap_is_the_one_written_out():
    rng = np.random.default_rng(8)
    reference, method = rng.uniform(1, 2, size=7), rng.uniform(0.5, 1.5, size=7)
    resampler = np.random.default_rng(0)
    resamples = []
    for _ in range(2000):
        drawn = resampler.integers(0, 7, size=7)
        resamples.append(100 * (1 - method[drawn].mean() / reference[drawn].mean()))
    gain = improvement(reference, method)
    assert gain.percent == pytest.approx(np.mean(resamples), abs=1e-12)
    assert gain.low == pytest.approx(np.quantile(resamples, 0.025), abs=1e-12)
    assert gain.high == pytest.approx(np.quantile(resamples, 0.975), abs=1e-12)
    assert (gain.reference_mean, gain.method_mean) == (reference.mean(), method.mean())


SPHERE = SphereRidge(1.0, 0.0, 1.0, 0.0)


def test_the_limit_of_the_held_out_ridges_is_the_published_one():
    improvements = envelope_limit(ridge_held_out(), budget=0.5, gate_sharpness=10.0)
    percent = [improvements[name].percent for name in ("distance_near", "distance", "hausdorff")]
    np.testing.assert_allclose(percent, (23.3, 19.2, 9.35), atol=0.05)


def test_the_oracle_keeps_to_the_envelope():
    instance = ridge_held_out().instances[8]
    scheme = oracle(instance.surface, budget=0.5, gate_sharpness=10.0)
    refined = refine(instance.mesh, scheme, reference_length=1.0)
    assert (refined.ratio <= refined.gate + 1e-12).all()
    assert refined.ratio.max() > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_no_network_does_better_at_any_vertex(seed):
    data = Dataset("few", saddle_held_out().instances[:1] + ridge_held_out().instances[8:9])
    limit = one_step_table(lambda instance: oracle(instance.surface, 0.5, 10.0), data)
    reached = one_step_table(pns(random_model(seed, scale=5.0), budget=0.5), data)
    for metric in ("distance", "hausdorff"):
        assert (reached[metric] >= limit[metric]).all()


SPHERE = SphereRidge(1.0, 0.0, 1.0, 0.0)


def test_nearest_points_of_a_ridge_are_as_near_as_a_dense_search_finds():
    instance = ridge_held_out().instances[8]
    ridge = instance.surface
    points = refine(instance.mesh, loop(), reference_length=1.0).mesh.vertices[:40]
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


def test_errors_of_an_icosphere_against_its_sphere():
    errors = shape_errors(SPHERE, icosphere(2))
    assert errors.distance < 1e-15
    assert errors.hausdorff < 1e-15
    # A face's normal is that of its circumcentre, near its centroid.
    assert errors.normal_max < 0.021
    assert 0 < errors.normal_mean <= errors.normal_max


def test_a_shifted_sphere_is_off_by_the_shift():
    vertices, faces = icosphere(2).vertices, icosphere(2).faces
    errors = shape_errors(SPHERE, Mesh(1.1 * vertices, faces))
    assert errors.distance == pytest.approx(0.1)
    assert errors.hausdorff == pytest.approx(0.1)
    assert errors.normal_max < 0.021


def test_the_normal_jump_is_the_reports():
    rng = np.random.default_rng(2)
    rough = icosphere(2)
    rough = Mesh(
        rough.vertices * (1 + 0.1 * rng.normal(size=(len(rough.vertices), 1))), rough.faces
    )
    refined = refine(rough, loop(), 2)
    assert normal_jump(refined.mesh) == pytest.approx(refined.levels[-1].normal_jump, abs=1e-12)


def test_a_sphere_bends_by_eight_pi_at_any_size():
    sphere = icosphere(4)
    for size in (1e-3, 1.0, 1e4):
        assert bending(Mesh(size * sphere.vertices, sphere.faces)) == pytest.approx(
            8 * np.pi, rel=0.01
        )


def test_a_torus_bends_as_its_integral_says():
    # κ₁ = 1 / r, κ₂ = cos v / (R + r cos v), dA = r (R + r cos v) du dv, R = 1, r = 0.4.
    v = (np.arange(20_000) + 0.5) / 20_000 * 2 * np.pi
    girth = 1 + 0.4 * np.cos(v)
    expected = 2 * np.pi * 0.4 * ((1 / 0.16 + (np.cos(v) / girth) ** 2) * girth).mean() * 2 * np.pi
    assert bending(torus(120, 60)) == pytest.approx(expected, rel=0.02)
