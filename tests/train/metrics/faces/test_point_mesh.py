"""Exact distances to triangles, against the formula on every triangle; ties by the lowest face."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, refine
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, rotation
from train.metrics.faces.point_mesh import face_tree, moved, nearest


def squared_distance(points, corners):
    """Of each point to its triangle: to the foot on its plane if that is inside, else to a side."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    area2 = (normal**2).sum(axis=1)
    height = ((points - a) * normal).sum(axis=1)
    inside, least = area2 > 0, np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        side, from_start = end - start, points - start
        length2 = (side**2).sum(axis=1)
        along = (from_start * side).sum(axis=1) / np.where(length2 > 0, length2, 1)
        off = from_start - np.clip(along, 0, 1)[:, None] * side
        least = np.minimum(least, (off**2).sum(axis=1))
        inside &= (np.cross(side, from_start) * normal).sum(axis=1) >= 0
    return np.where(inside, height**2 / np.where(area2 > 0, area2, 1), least)


def distances_to_all(points, mesh):
    every = np.tile(mesh.vertices[mesh.faces], (len(points), 1, 1))
    pairs = squared_distance(np.repeat(points, len(mesh.faces), axis=0), every)
    return np.sqrt(pairs.reshape(len(points), -1))


def points_near(mesh, count, rng):
    """Some on vertices, some close, some far away."""
    extent = np.ptp(mesh.vertices, axis=0).max()
    away = extent * rng.choice([0, 1e-3, 0.1, 30], (count, 1))
    chosen = mesh.vertices[rng.integers(0, len(mesh.vertices), count)]
    return chosen + away * rng.standard_normal((count, 3))


@pytest.mark.parametrize("shape", [bumpy_sphere(), grid(9, bent)], ids=["sphere", "patch"])
def test_distances_of_refined_meshes_are_the_least_of_all_triangles(shape):
    mesh = refine(Mesh(*shape), loop(), 1, threads=1).mesh
    points = points_near(mesh, 300, np.random.default_rng(0))
    distances = nearest(face_tree(mesh), points).distance
    least = distances_to_all(points, mesh).min(axis=1)
    np.testing.assert_allclose(distances, least, rtol=1e-12, atol=1e-14)


@given(manifolds(), st.integers(0, 2**32 - 1))
def test_distance_point_and_face_of_any_manifold_belong_together(mesh, seed):
    points = points_near(mesh, 20, np.random.default_rng(seed))
    closest, every = nearest(face_tree(mesh), points), distances_to_all(points, mesh)
    size = np.ptp(mesh.vertices)
    np.testing.assert_allclose(closest.distance, every.min(axis=1), rtol=1e-9, atol=1e-9 * size)
    away = np.linalg.norm(points - closest.point, axis=1)
    np.testing.assert_allclose(away, closest.distance, rtol=1e-9, atol=1e-9 * size)
    named = every[np.arange(len(points)), closest.face]
    np.testing.assert_allclose(named, closest.distance, rtol=1e-6, atol=1e-7 * size)


TRIANGLE = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]])


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((1, 1, 2), 2),  # above the inside
        ((1, -3, 4), 5),  # beyond a side
        ((-2, -2, 1), 3),  # beyond a corner
        ((4, 3, 0), 2.4),  # before the long side, in the plane
        ((4, 0, 0), 0),
        ((2, 1.5, 0), 0),
    ],
)
def test_the_nearest_point_lies_inside_on_a_side_or_at_a_corner(point, distance):
    closest = nearest(
        face_tree(Mesh(TRIANGLE, np.array([[0, 1, 2]]))), np.array([point], dtype=float)
    )
    np.testing.assert_allclose(closest.distance, [distance], atol=1e-15)
    assert closest.face == [0]


@pytest.mark.parametrize("turn", range(6))
def test_of_equally_near_faces_the_lowest_is_named(turn):
    """Above the vertices, the edges' middles and the faces' of an octahedron in any numbering.

    Where it is turned, rounding says which are nearer.
    """
    points = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[i, j, k] for i in (0, 3) for j in (1, 4) for k in (2, 5)])
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    rng = np.random.default_rng(turn)
    faces = faces[rng.permutation(len(faces))]
    turned = points @ rotation(rng).T + [4, -8, 2]
    ends = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    for corners in (np.arange(6)[:, None], ends, faces):
        belongs = np.array([[np.isin(own, face).all() for face in faces] for own in corners])
        for at in (points, turned):
            above = 1.5 * at[corners].mean(axis=1) - 0.5 * at.mean(axis=0)
            closest = nearest(face_tree(Mesh(at, faces)), above)
            np.testing.assert_array_equal(closest.face, belongs.argmax(axis=1))


@pytest.mark.parametrize("turn", range(4))
def test_between_two_sheets_the_lowest_face_is_named_whatever_came_before(turn):
    rng = np.random.default_rng(turn)
    low, faces = grid(8)
    high = low + np.array([0, 0, 0.5])
    turned = rng.permutation(2 * len(faces))
    mesh = Mesh(np.concatenate([low, high]), np.concatenate([faces, faces + len(low)])[turned])
    # Each foot lies well inside a face.
    inside = low[faces].mean(axis=1) + np.array([0, 0, 0.25])
    points = inside[rng.integers(0, len(inside), 300)]
    closest = nearest(face_tree(mesh), points)
    every = distances_to_all(points, mesh)
    np.testing.assert_array_equal(closest.face, np.isclose(every, 0.25, rtol=1e-12).argmax(axis=1))


def test_a_moved_tree_answers_as_a_new_one():
    mesh = refine(Mesh(*bumpy_sphere()), loop(), 1, threads=1).mesh
    rng = np.random.default_rng(0)
    other = Mesh(mesh.vertices * [1, 2, 0.5] + 0.01 * rng.normal(size=(1, 3)), mesh.faces)
    points = points_near(other, 300, rng)
    new, old = (
        nearest(tree, points) for tree in (face_tree(other), moved(face_tree(mesh), other.vertices))
    )
    np.testing.assert_array_equal(new.distance, old.distance)
    np.testing.assert_array_equal(new.face, old.face)


def test_points_alone_give_what_they_give_together():
    mesh = Mesh(*grid(5, bent))
    tree, points = face_tree(mesh), points_near(Mesh(*grid(5, bent)), 400, np.random.default_rng(0))
    together, alone = nearest(tree, points), nearest(tree, points[-10:])
    np.testing.assert_array_equal(together.distance[-10:], alone.distance)
    np.testing.assert_array_equal(together.face[-10:], alone.face)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_what_is_beyond_all_numbers_is_as_far_and_ends(value):
    tree = face_tree(Mesh(*bumpy_sphere(0, subdivisions=1)))
    point = nearest(tree, np.array([[value, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    assert not np.isfinite(point.distance[0])
    assert point.distance[1] == nearest(tree, np.array([[2.0, 0.0, 0.0]])).distance[0]
