"""Exact distances to triangles, against libigl's and closed forms."""

import igl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, refine
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, soups
from train.metrics.point_mesh import BLOCK, LEAF, box_tree, farthest, nearest, squared_distance


def igl_distance(points, mesh):
    squared, _, _ = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)
    return np.sqrt(squared)


def points_near(mesh, count, rng):
    """Some on vertices, some close, some far away."""
    extent = np.ptp(mesh.vertices, axis=0).max()
    away = extent * rng.choice([0, 1e-3, 0.1, 30], (count, 1))
    chosen = mesh.vertices[rng.integers(0, len(mesh.vertices), count)]
    return chosen + away * rng.standard_normal((count, 3))


@pytest.mark.parametrize("shape", [bumpy_sphere(), grid(9, bent)], ids=["sphere", "patch"])
def test_distances_of_refined_meshes_are_libigls(shape):
    mesh = refine(Mesh(*shape), loop(), 2, threads=1).mesh
    points = points_near(mesh, 2000, np.random.default_rng(0))
    distances = nearest(box_tree(mesh), points).distance
    np.testing.assert_allclose(distances, igl_distance(points, mesh), rtol=1e-12, atol=1e-14)


@given(manifolds(), st.integers(0, 2**32 - 1))
def test_distances_of_any_manifold_are_libigls(mesh, seed):
    points = points_near(mesh, 50, np.random.default_rng(seed))
    distances = nearest(box_tree(mesh), points).distance
    np.testing.assert_allclose(distances, igl_distance(points, mesh), rtol=1e-9, atol=1e-12)


@given(soups(), st.integers(0, 2**32 - 1))
def test_no_box_is_left_out_that_holds_the_nearest_triangle(mesh, seed):
    """Also where triangles have no area: the same formula on every triangle, without the tree."""
    points = points_near(mesh, 20, np.random.default_rng(seed))
    every = np.tile(mesh.vertices[mesh.faces], (len(points), 1, 1))
    pairs = squared_distance(np.repeat(points, len(mesh.faces), axis=0), every)
    least = np.sqrt(pairs.reshape(len(points), -1).min(axis=1))
    np.testing.assert_array_equal(nearest(box_tree(mesh), points).distance, least)


def test_the_face_that_is_named_is_as_near_as_the_distance_says():
    mesh = Mesh(*bumpy_sphere())
    points = points_near(mesh, 500, np.random.default_rng(0))
    closest = nearest(box_tree(mesh), points)
    there = squared_distance(points, mesh.vertices[mesh.faces[closest.face]])
    np.testing.assert_array_equal(np.sqrt(there), closest.distance)


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
    squares = squared_distance(np.array([point], dtype=float), TRIANGLE[None])
    np.testing.assert_allclose(np.sqrt(squares), [distance], atol=1e-15)


@pytest.mark.parametrize(
    "corners", [[[0, 0, 0], [2, 0, 0], [1, 0, 0]], [[0, 0, 0], [2, 0, 0], [2, 0, 0]]]
)
def test_a_triangle_without_area_is_its_longest_side(corners):
    corners = np.array([corners], dtype=float)
    for point, distance in (((1, 0, 3), 3), ((3, 0, 0), 1), ((-3, 4, 0), 5)):
        squares = squared_distance(np.array([point], dtype=float), corners)
        np.testing.assert_allclose(np.sqrt(squares), [distance], atol=1e-15)


def test_one_triangle_is_a_tree_of_one_box():
    tree = box_tree(Mesh(TRIANGLE, [[0, 1, 2]]))
    assert len(tree.lower) == 1
    assert len(tree.order) == LEAF
    closest = nearest(tree, np.array([[1.0, 1, 2]]))
    np.testing.assert_array_equal(closest.distance, [2])
    np.testing.assert_array_equal(closest.face, [0])


def test_blocks_of_points_change_nothing():
    mesh = Mesh(*grid(3, bent))
    tree = box_tree(mesh)
    points = points_near(mesh, BLOCK + 5, np.random.default_rng(0))
    closest = nearest(tree, points)
    last = nearest(tree, points[-10:])
    assert closest.distance.shape == closest.face.shape == (BLOCK + 5,)
    np.testing.assert_array_equal(closest.distance[-10:], last.distance)
    np.testing.assert_array_equal(closest.face[-10:], last.face)


def test_the_farthest_point_is_found_without_all_distances():
    mesh = refine(Mesh(*bumpy_sphere()), loop(), 1, threads=1).mesh
    tree, rng = box_tree(mesh), np.random.default_rng(0)
    for count in (1, 50, 5000):
        points = points_near(mesh, count, rng)
        largest = igl_distance(points, mesh).max()
        assert farthest(tree, points, 0.0) == pytest.approx(largest, rel=1e-12)
        assert farthest(tree, points, 1e3) == 1e3
