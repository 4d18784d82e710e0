"""Measures are what they are called: by closed forms, dense searches, every pair of faces."""

import numpy as np
import pytest

from pns_common import Mesh, loop, pns
from tests.support.meshes import bumpy_sphere, grid, icosphere, rotation
from tests.support.networks import random_model
from train.connectivity import connect
from train.data.datasets import Dataset, ridge_held_out, saddle_held_out, sphere_ridge_held_out
from train.metrics.card import one_step_table
from train.metrics.envelope import envelope_limit, oracle
from train.metrics.one_step import fan_normal, improvement, one_step_errors
from train.metrics.self_intersection import crossing_faces
from train.metrics.shape import nearest_points, shape_errors
from train.metrics.surface_distance import prepared, surface_errors
from train.metrics.whole_surface import normal_jump
from train.refining import figures, refine
from train.surfaces.implicit import Ridge, SphereRidge, unit_normal

SPHERE = SphereRidge(1.0, 0.0, 1.0, 0.0)


# --- one step, as it was published ----------------------------------------------------------------


def test_points_off_a_sphere_are_off_by_their_distance():
    mesh = sphere_ridge_held_out().instances[0].mesh
    level = connect(mesh.faces, len(mesh.vertices))
    inserted = mesh.vertices[level.edges[level.interior]].mean(axis=1)
    inserted /= np.linalg.norm(inserted, axis=1, keepdims=True)
    for off in (0.0, 0.25):
        errors = one_step_errors(SPHERE, mesh.vertices, level, (1 + off) * inserted)
        assert errors.distance == pytest.approx(off, abs=1e-15)
        assert errors.hausdorff == pytest.approx(off, abs=1e-15)


def test_the_published_normal_sees_an_inserted_vertex_only_where_it_folds_a_face():
    """Edge (0, 1) with c = 2 on its left and d = 3 on its right, in space."""
    coarse = np.array([[0, 0, 0], [1, 0, 0.2], [0.4, 0.9, 0.3], [0.6, -0.8, 0.1]])
    level = connect(np.array([[0, 1, 2], [1, 0, 3]]), 4)
    a, b, c, d = coarse
    for offset in (0.0, 0.05, -0.05):
        normal = fan_normal(coarse, level, np.array([[0.5, 0.0, 0.1 + offset]]))
        np.testing.assert_allclose(normal, np.cross(b - a, c - d)[None], rtol=0, atol=1e-15)
    q = np.array([-0.5, 0.6, 0.1])
    n1, n2 = np.cross(b - a, c - a), np.cross(a - b, d - b)
    areas = [np.cross(u - q, v - q) for u, v in ((a, c), (c, b), (b, d), (d, a))]
    # The four run a → c → b → d round q: against the faces, so that all are turned.
    turned = sum(area * np.sign(area @ n) for area, n in zip(areas, (n1, n1, n2, n2), strict=True))
    np.testing.assert_allclose(fan_normal(coarse, level, q[None])[0], turned, atol=1e-15)


def test_bootstrap_is_the_one_written_out():
    rng, resampler = np.random.default_rng(8), np.random.default_rng(0)
    reference, method = rng.uniform(1, 2, size=7), rng.uniform(0.5, 1.5, size=7)
    drawn = [resampler.integers(0, 7, size=7) for _ in range(2000)]
    resamples = [100 * (1 - method[rows].mean() / reference[rows].mean()) for rows in drawn]
    gain = improvement(reference, method)
    assert gain.percent == pytest.approx(np.mean(resamples), abs=1e-12)
    assert (gain.low, gain.high) == pytest.approx(np.quantile(resamples, [0.025, 0.975]), abs=1e-12)
    assert (gain.reference_mean, gain.method_mean) == (reference.mean(), method.mean())


def test_the_limit_of_the_held_out_ridges_is_the_published_one():
    improvements = envelope_limit(ridge_held_out(), budget=0.5, gate_sharpness=10.0)
    percent = [improvements[name].percent for name in ("distance_near", "distance", "hausdorff")]
    np.testing.assert_allclose(percent, (23.3, 19.2, 9.35), atol=0.05)


def test_the_oracle_keeps_to_the_envelope_and_no_network_does_better_at_any_vertex():
    instance = ridge_held_out().instances[8]
    scheme = oracle(instance.surface, budget=0.5, gate_sharpness=10.0)
    refined = refine(instance.mesh, scheme, reference_length=1.0)
    assert (refined.ratio <= refined.gate + 1e-12).all()
    assert refined.ratio.max() > 0.9
    data = Dataset("few", (*saddle_held_out().instances[:1], instance))
    limit = one_step_table(lambda instance: oracle(instance.surface, 0.5, 10.0), data)
    for seed in range(3):
        reached = one_step_table(pns(random_model(seed, scale=5.0), budget=0.5), data)
        for metric in ("distance", "hausdorff"):
            assert (reached[metric] >= limit[metric]).all()


# --- whole surfaces -------------------------------------------------------------------------------


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


@pytest.mark.parametrize("share", [-0.7, 0.6])
def test_nearest_points_are_found_up_to_where_they_meet(share):
    """On the normal at a crest, at a share of the radius of curvature there, inside or outside."""
    ridge = Ridge(0.5, 8.0, 0.0, 0.0, 0.0)
    radius = 1 / (2 * ridge.sharpness * ridge.amplitude)
    points = np.array([[x, 1e-4, ridge.amplitude + share * radius] for x in (-0.3, 0.4)])
    found = nearest_points(ridge, points)
    away, normal = points - found, unit_normal(ridge, found)
    aside = away - (away * normal).sum(axis=1)[:, None] * normal
    np.testing.assert_allclose(aside, 0, atol=1e-9)
    assert np.linalg.norm(away, axis=1) == pytest.approx(abs(share) * radius, rel=1e-4)


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_a_sphere_is_off_by_its_shift_and_its_normals_by_nearly_nothing(off):
    vertices, faces = icosphere(2)
    errors = shape_errors(SPHERE, Mesh((1 + off) * vertices, faces))
    assert errors.distance == pytest.approx(off, abs=1e-15)
    assert errors.hausdorff == pytest.approx(off, abs=1e-15)
    # A face's normal is that of its circumcentre, near its centroid.
    assert 0 < errors.normal_mean <= errors.normal_max < 0.021


def test_the_normal_jump_is_the_reports():
    refined = refine(Mesh(*bumpy_sphere(subdivisions=2)), loop(), 2)
    assert normal_jump(refined.mesh) == pytest.approx(figures(refined)[-1].normal_jump, abs=1e-12)


# --- two meshes as surfaces -----------------------------------------------------------------------


def errors_of(true, refined, samples=2000):
    return surface_errors(prepared(true, samples), prepared(refined, samples))


def test_parallel_and_tilted_planes_are_their_gap_and_their_angle_apart():
    plane, c, s = Mesh(*grid(5)), np.cos(0.2), np.sin(0.2)
    apart = errors_of(plane, Mesh(np.add(plane.vertices, [0, 0, 0.25]), plane.faces))
    for metric in ("mean", "p95", "hausdorff"):
        assert getattr(apart, metric) == pytest.approx(0.25 / 8**0.5, rel=1e-12)
    assert apart.normal == pytest.approx(0, abs=1e-12)
    tilted = Mesh(plane.vertices @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]), plane.faces)
    assert errors_of(plane, tilted).normal == pytest.approx(0.2, rel=1e-12)


def test_both_ways_are_seen():
    """Half a plane lies in the whole one; the whole one's far side is one length away from it."""
    whole = Mesh(*grid(9))
    half = Mesh(whole.vertices * [0.5, 1, 1] - [0.5, 0, 0], whole.faces)
    for true, refined in ((whole, half), (half, whole)):
        measured = errors_of(true, refined, samples=20_000)
        diagonal = np.linalg.norm(np.ptp(true.vertices, axis=0))
        # One way nothing; the other way 0 on one half, evenly 0 … 1 on the other.
        assert measured.mean == pytest.approx((0 + 0.25) / 2 / diagonal, rel=1e-3)
        assert measured.p95 == pytest.approx((0 + 0.9) / 2 / diagonal, rel=5e-3)
        assert measured.hausdorff == pytest.approx(1 / diagonal, rel=1e-12)


def test_errors_do_not_change_with_place_and_size():
    true, refined = Mesh(*icosphere(2)), Mesh(*bumpy_sphere(subdivisions=2))
    turn, before = rotation(np.random.default_rng(0)), errors_of(true, refined)
    placed = [Mesh(40 * mesh.vertices @ turn.T, mesh.faces) for mesh in (true, refined)]
    after = errors_of(*placed)
    # The bounding box does not turn with the mesh: compare in its units.
    sizes = [np.linalg.norm(np.ptp(mesh.vertices, axis=0)) for mesh in (placed[0], true)]
    for metric in ("mean", "p95", "hausdorff"):
        unit = sizes[0] / 40 / sizes[1]
        assert getattr(after, metric) * unit == pytest.approx(getattr(before, metric), rel=1e-9)
    # Where the nearest point is on an edge, rounding chooses the face.
    assert after.normal == pytest.approx(before.normal, rel=1e-2)


# --- crossing faces -------------------------------------------------------------------------------


def by_every_pair(mesh):
    """Solve for where each edge meets each face's plane: slow, and written otherwise."""
    crossing = np.zeros(len(mesh.faces), dtype=bool)
    for i, face in enumerate(mesh.faces):
        for j, other in enumerate(mesh.faces):
            if i == j or len(set(face) & set(other)) > 1:
                continue
            a, b, c = mesh.vertices[other]
            for corner in range(3):
                start, end = mesh.vertices[face[corner]], mesh.vertices[face[(corner + 1) % 3]]
                matrix = np.stack([b - a, c - a, start - end], axis=1)
                if abs(np.linalg.det(matrix)) < 1e-14:
                    continue
                u, v, t = np.linalg.solve(matrix, start - a)
                if min(u, v, t) > 1e-9 and u + v < 1 - 1e-9 and t < 1 - 1e-9:
                    crossing[i] = crossing[j] = True
    return crossing


@pytest.mark.parametrize("noise", [0.05, 0.15, 0.4])
def test_crossing_faces_are_those_of_every_pair(noise):
    vertices, faces = icosphere(1)
    shake = noise * np.random.default_rng(2).normal(size=vertices.shape)
    mesh = Mesh(vertices + shake, faces)
    np.testing.assert_array_equal(crossing_faces(mesh), by_every_pair(mesh))


def test_a_wall_of_rulings_does_not_cross_itself_by_rounding():
    """Along a ruling all faces lie in one plane but for rounding."""
    rng = np.random.default_rng(0)
    bend = np.cumsum(rng.uniform(-0.2, 0.2, 9))
    line = np.cumsum(np.stack([np.cos(bend), np.sin(bend)], axis=1), axis=0)
    heights = np.cumsum(rng.uniform(0.1, 1.0, 9)) / 3
    points = np.array([[x, y, z] for x, y in line for z in heights])
    noise = 1e-11 * rng.normal(size=points.shape)
    wall = Mesh(points @ rotation(rng) + noise, grid(9)[1])
    assert not crossing_faces(wall).any()


@pytest.mark.parametrize(("low", "crosses"), [(-1.0, True), (0.0, False), (None, False)])
def test_faces_that_touch_or_overlap_in_one_plane_do_not_cross(low, crosses):
    """A triangle that reaches down to a height over another one; None: it lies on it."""
    flat = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0.0]])
    other = np.array([[1, 1, 0], [2, 1, 0], [1, 2, 0.0]])
    if low is not None:
        other = np.array([[1, 1, low], [2, 1, 1], [1, 2, 1]])
    mesh = Mesh(np.concatenate([flat, other]), np.arange(6).reshape(2, 3))
    assert crossing_faces(mesh).tolist() == [crosses, crosses]
