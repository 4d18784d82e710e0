"""Limits are where refinement leads; normals are those of the surface there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases
from pns_common.carry.columns import level_topologies, refine_columns
from pns_common.mesh.normals import face_normals
from pns_common.mesh.sectors import find_sectors
from pns_common.mesh.topology import build_topology
from pns_common.parallel import Blocks
from pns_common.schemes import LOOP
from pns_common.schemes.limit import limit_normals, limit_positions, limit_shift
from pns_common.schemes.loop_limit import dart_tangents
from tests.support.meshes import bent, bumpy_sphere, grid, icosphere, manifolds, soups


def star(k, closed):
    """A vertex with k faces around it."""
    rng = np.random.default_rng(k)
    angle = np.linspace(0, 2 * np.pi, k, endpoint=False) if closed else np.linspace(0, 3, k + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([[[0, 0, 0.3]], ring]) + 0.1 * rng.standard_normal((len(ring) + 1, 3))
    return points, np.array([[0, 1 + j, 1 + (j + 1) % len(ring)] for j in range(k)])


def creased(faces, count, pairs):
    topology = build_topology(np.array(faces), count)
    return topology.with_creases(topology.rows_of(np.array(pairs, dtype=int).reshape(-1, 2)))


def randomly_creased(mesh, seed):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rng = np.random.default_rng(seed)
    return topology.with_creases(np.flatnonzero(rng.random(len(topology.edges)) < 1 / 3))


def stepped(points, topology):
    return LOOP.place(points, topology, Blocks()), LOOP.split(topology, Blocks())


# --- positions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [3, 4, 5, 6, 9, 40])
def test_smooth_vertices_follow_loops_formula(k):
    points, faces = star(k, closed=True)
    beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
    weight = 1 / (3 / (8 * beta) + k)
    expected = (1 - k * weight) * points[0] + weight * points[1:].sum(axis=0)
    limit = limit_positions(points, build_topology(faces, k + 1))[0]
    np.testing.assert_allclose(limit, expected, atol=1e-15)


@given(st.one_of(manifolds(), soups()), st.integers(0, 2**31))
def test_a_step_leaves_limits_where_they_are(mesh, seed):
    points = mesh.vertices / np.abs(mesh.vertices).max()
    topology = randomly_creased(mesh, seed)
    refined, after = stepped(points, topology)
    limit = limit_positions(refined, after)[: len(points)]
    np.testing.assert_allclose(limit, limit_positions(points, topology), rtol=0, atol=1e-12)


@pytest.mark.parametrize("creases", [None, np.array([[7, 8], [8, 14], [14, 15]])])
def test_deep_refinement_arrives_there(creases):
    points, faces = grid(6, bent)
    topologies = level_topologies(faces, len(points), 7, Creases(creases))
    deep = refine_columns(points, topologies)[: len(points)]
    np.testing.assert_allclose(deep, limit_positions(points, topologies[0]), rtol=0, atol=1e-4)


@given(st.one_of(manifolds(), soups()), st.integers(0, 2**31), st.booleans())
def test_masks_are_convex(mesh, seed, soft):
    topology, rng = randomly_creased(mesh, seed), np.random.default_rng(seed)
    if soft:
        topology = topology.with_sharpness(rng.random(len(topology.edges)))
    weights = limit_positions(np.eye(len(mesh.vertices)), topology)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-14)


@pytest.mark.parametrize("w", [0.0, 0.3, 1.0])
def test_soft_edges_blend_the_rules(w):
    points, faces = star(6, closed=True)
    plain = build_topology(faces, 7)
    sharpness = np.zeros(len(plain.edges))
    # Three edges of sharpness 1, w and w / 2.
    rows = plain.rows_of(np.array([[0, 1], [0, 3], [0, 4]]))
    sharpness[rows] = [1, w, w / 2]
    limit = limit_positions(points, plain.with_sharpness(sharpness))[0]
    dart = limit_positions(points, creased(faces, 7, [[0, 1]]))[0]
    curve = (4 * points[0] + points[1] + points[3]) / 6
    expected = (1 - w) * dart + w / 2 * curve + w / 2 * points[0]
    np.testing.assert_allclose(limit, expected, atol=1e-14)


def test_a_crease_moves_limits_as_far_as_is_said():
    points, faces = bumpy_sphere()
    smooth = build_topology(faces, len(points))
    assert limit_shift(points, smooth) == 0.0
    sharp = creased(faces, len(points), [faces[0, :2], faces[0, 1:]])
    moved = limit_positions(points, sharp) - limit_positions(points, smooth)
    assert limit_shift(points, sharp) == pytest.approx(np.linalg.norm(moved, axis=1).max())
    sharpness = np.where(np.arange(len(smooth.edges)) < 9, 0.5, 0)
    assert limit_shift(points, smooth.with_sharpness(sharpness)) > 0


@given(st.one_of(manifolds(), soups()), st.integers(0, 2**31))
def test_limits_do_not_depend_on_threads(mesh, seed):
    topology, blocks = randomly_creased(mesh, seed), Blocks(2, rows=5)
    columns = np.random.default_rng(seed).standard_normal((len(mesh.vertices), 5))
    whole = limit_positions(columns, topology)
    np.testing.assert_array_equal(limit_positions(columns, topology, blocks), whole)
    one = limit_normals(mesh.vertices, topology)
    many = limit_normals(mesh.vertices, topology, blocks)
    np.testing.assert_array_equal(many.vertices, one.vertices)
    np.testing.assert_array_equal(many.sectors, one.sectors)


# --- normals --------------------------------------------------------------------------------------


def test_on_a_sphere_normals_point_outwards_and_on_a_plane_along_its_normal():
    points, faces = icosphere(2)
    normals = limit_normals(points, build_topology(faces, len(points))).vertices
    assert np.sum(normals * points, axis=1).min() > np.cos(0.03)
    flat, faces = grid(5)
    normals = limit_normals(flat, build_topology(faces, len(flat))).vertices
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(flat), 1)), atol=1e-14)


@given(manifolds(), st.integers(0, 2**31))
def test_a_step_leaves_normals_as_they_are(mesh, seed):
    topology = randomly_creased(mesh, seed)
    refined, after = stepped(mesh.vertices, topology)
    normals = limit_normals(mesh.vertices, topology)
    later = limit_normals(refined, after)
    # The child at corner i of face f is face 4 f + i, and has the corner first.
    child = 4 * (np.arange(mesh.faces.size) // 3) + np.arange(mesh.faces.size) % 3
    one_sided = normals.sectors[normals.sector_of_corner]
    again = later.sectors[later.sector_of_corner[3 * child]]
    # At corners the faces around say which way is out, and these change.
    sharp = np.bincount(
        topology.edges[topology.sharp_edges].reshape(-1), minlength=len(mesh.vertices)
    )
    at_corner = sharp[topology.corners] > 2
    again[at_corner] *= np.sign(np.sum(again * one_sided, axis=1, keepdims=True))[at_corner]
    np.testing.assert_allclose(again, one_sided, atol=1e-7)


def test_both_sides_of_a_crease_have_their_own_normal():
    """A roof: its ridge is a crease, and the slopes stay flat beside it."""
    points, faces = grid(5, lambda x, y: -np.abs(x))
    ridge = np.flatnonzero(points[:, 0] == 0)
    topology = creased(faces, len(points), np.stack([ridge[:-1], ridge[1:]], axis=1))
    normals, middle = limit_normals(points, topology), ridge[2]
    sides = normals.sectors[normals.sector_of_corner][topology.corners == middle]
    slopes = np.unique(np.round(sides * np.sqrt(2), 9), axis=0)
    np.testing.assert_allclose(slopes, [[-1, 0, 1], [1, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(normals.vertices[middle], [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("mesh", [bumpy_sphere(3), grid(5, bent), icosphere(0)])
def test_normals_are_those_of_the_faces_of_a_deep_refinement(mesh):
    points, faces = mesh
    topologies = level_topologies(faces, len(points), 6)
    deep = refine_columns(points, topologies)
    small = LOOP.split(topologies[-1], Blocks()).faces
    exact = limit_normals(points, topologies[0]).vertices
    normals = face_normals(deep, small)
    for v in range(len(points)):
        around = normals[(small == v).any(axis=1)]
        assert (around @ exact[v]).min() > np.cos(0.06)


def test_a_corner_wider_than_half_a_turn_looks_where_its_faces_do():
    """Three creases meet in a plane: sectors of 45, 45 and 270 degrees."""
    angle = np.pi / 4 * np.arange(8)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points, faces = np.concatenate([np.zeros((1, 3)), ring]), star(8, closed=True)[1]
    normals = limit_normals(points, creased(faces, 9, [[0, 1], [0, 2], [0, 3]]))
    assert len(np.unique(normals.sector_of_corner[::3])) == 3
    np.testing.assert_allclose(normals.sectors[:, 2], 1, atol=1e-12)


@pytest.mark.parametrize("crease", [[], [[3, 4]]])
def test_normals_that_cancel_are_zero(crease):
    """A sheet that is there from both sides has none."""
    rng = np.random.default_rng(0)
    points, faces = grid(5, lambda x, y: rng.uniform(-0.3, 0.3, x.shape))
    twice = np.concatenate([faces, faces[:, ::-1]])
    for turned in (points, points @ np.linalg.qr(rng.normal(size=(3, 3)))[0]):
        refined, after = stepped(turned, creased(twice, len(points), crease))
        assert not limit_normals(refined, after).vertices.any()


def test_a_fold_takes_no_part_in_the_normal_of_a_vertex_with_other_faces():
    """Two faces there and back, at a vertex of another: the normal there is the other one's."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, -1, 1], [0.9, -1, 2.0]])
    faces = np.array([[0, 1, 2], [0, 3, 4], [4, 3, 0]])
    normals = limit_normals(points, build_topology(faces, len(points))).vertices
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("k", [3, 5, 8, 9, 10, 33, 200])
def test_tangents_of_a_dart_shrink_alike_in_every_step(k):
    even, odd = dart_tangents(k)
    assert even.sum() == pytest.approx(0, abs=1e-12)
    points, faces = star(k, closed=True)
    topology = creased(faces, k + 1, [[0, 1]])
    # Where edge (0, j) led, its vertex lies after a step.
    spokes = topology.rows_of(np.stack([np.zeros(k, dtype=int), np.arange(1, k + 1)], axis=1))
    refined, _ = stepped(points, topology)
    after = np.concatenate([refined[:1], refined[k + 1 + spokes]])
    for mask in (even, np.concatenate([[0], odd])):
        before, later = mask @ points, mask @ after
        np.testing.assert_allclose(np.cross(before, later), 0, atol=1e-12)


def test_a_vertex_of_a_hundred_thousand_spokes_has_limit_and_normal():
    points, faces = star(100_000, closed=True)
    for pairs in ([], [[0, 2]]):
        topology = creased(faces, len(points), pairs)
        assert np.isfinite(limit_positions(points, topology)).all()
        normal = limit_normals(points, topology).vertices[0]
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-12)


# --- sectors --------------------------------------------------------------------------------------


@given(st.one_of(manifolds(), soups()))
def test_every_corner_is_in_one_sector_of_its_own_vertex(mesh):
    around = find_sectors(build_topology(mesh.faces, len(mesh.vertices)).connectivity)
    np.testing.assert_array_equal(around.vertex[around.of_corner], mesh.faces.reshape(-1))
    np.testing.assert_array_equal(np.bincount(around.of_corner), around.size)
