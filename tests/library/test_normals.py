"""Normals of groups of corners, the fans that share them, and tangents at right angles to them."""

import numpy as np
import pytest
import trimesh
from hypothesis import given

from pns_common.mesh.normals import angle_weighted_normals, perpendicular_tangents, smooth_fans
from pns_common.mesh.rows import number_by_first_appearance, unit
from pns_common.parallel import Blocks
from tests.support.meshes import bow_tie, bumpy_sphere, soups

BLOCKS = Blocks(threads=2, rows=100)


def test_normals_equal_trimesh_on_a_smooth_surface():
    points, faces = bumpy_sphere(subdivisions=2, bump=0.05)
    ours = angle_weighted_normals(points, faces, faces, len(points), BLOCKS)
    theirs = trimesh.Trimesh(points, faces, process=False).vertex_normals
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_a_triangulation_of_a_cube_does_not_bend_its_normals():
    # The point of angles as weights: a corner of a cube is symmetric however its sides are cut.
    cube = trimesh.creation.box()
    faces = cube.faces.astype(np.int64)
    points = np.array(cube.vertices)
    normals = angle_weighted_normals(points, faces, faces, 8, BLOCKS)
    np.testing.assert_allclose(normals, np.sign(points) / np.sqrt(3), atol=1e-12)


@given(soups())
def test_a_face_cut_into_triangles_counts_as_those_that_are_not_turned_over(mesh):
    points, count = mesh.vertices, len(mesh.vertices)
    pairs = np.hstack([mesh.faces, mesh.faces[::-1]])
    cut = np.array([[0, 1, 2], [3, 4, 5]])
    together = angle_weighted_normals(points, pairs, pairs, count, BLOCKS, cut)
    a, b, c = np.moveaxis(points[pairs.reshape(-1, 2, 3)], 2, 0)
    areas = np.cross(b - a, c - a)
    turned = np.einsum("ftk,fk->ft", areas, areas.sum(axis=1)) < 0
    alone = pairs.reshape(-1, 2, 3)[~turned]
    expected = angle_weighted_normals(points, alone, alone, count, Blocks())
    np.testing.assert_array_equal(together, expected)


@pytest.mark.parametrize("scale", [1e-38, 1e-10, 1.0, 1e38])
def test_normals_do_not_depend_on_the_unit_of_length(scale):
    points = scale * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2]])
    normals = angle_weighted_normals(points, faces, faces, 3, BLOCKS)
    np.testing.assert_allclose(normals, [[0, 0, 1]] * 3, atol=1e-12)


def test_tangents_along_the_normal_are_replaced_by_a_perpendicular():
    rng = np.random.default_rng(0)
    normals = unit(rng.standard_normal((50, 3)))
    tangents = np.concatenate([2 * normals[:20], 0 * normals[20:30], rng.standard_normal((20, 3))])
    flat = perpendicular_tangents(tangents, normals, Blocks(threads=2, rows=7))
    np.testing.assert_allclose(np.linalg.norm(flat, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose((flat * normals).sum(axis=1), 0, atol=1e-12)
    # A tangent that has a direction keeps its side.
    assert ((flat * tangents).sum(axis=1)[30:] > 0).all()


# --- fans -----------------------------------------------------------------------------------------


def fans_at(vertex, points, faces, creases=None):
    """Return how many fans there are at a vertex; no two vertices share one."""
    fans = smooth_fans(faces, len(points), creases)
    assert len({(fan, v) for fan, v in zip(fans.flat, faces.flat, strict=True)}) == fans.max() + 1
    return len(np.unique(fans[faces == vertex]))


def test_fans_of_a_smooth_surface_are_its_vertices_as_they_first_appear():
    points, faces = bumpy_sphere(0, subdivisions=2)
    expected = number_by_first_appearance(faces.reshape(-1))[0].reshape(-1, 3)
    np.testing.assert_array_equal(smooth_fans(faces, len(points), None), expected)


def test_a_vertex_has_as_many_fans_as_creases_part_it_into():
    points, around = np.zeros((6, 3)), 1 + np.arange(5)
    faces = np.stack([0 * around, around, np.roll(around, -1)], axis=1)
    counts = [fans_at(0, points, faces, np.array([[0, 1], [3, 0], [0, 4]])[:n]) for n in range(4)]
    # One crease ends there: the faces still follow one another the other way round.
    assert counts == [1, 1, 2, 3]


def test_a_bow_tie_has_two_fans_where_it_is_pinched():
    assert fans_at(0, *bow_tie()) == 2


# --- angles ---------------------------------------------------------------------------------------
