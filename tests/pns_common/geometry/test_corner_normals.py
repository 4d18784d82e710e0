"""Normals of groups of corners against an independent implementation, and where there are none."""

import numpy as np
import pytest
import trimesh

from pns_common.base.blocks import Blocks
from pns_common.geometry.corner_normals import angle_weighted_normals

BLOCKS = Blocks(threads=1, rows=100)


def test_normals_equal_trimesh_on_a_smooth_surface():
    sphere = trimesh.creation.icosphere(subdivisions=2)
    rng = np.random.default_rng(0)
    points = sphere.vertices + 0.05 * rng.standard_normal(sphere.vertices.shape)
    faces = sphere.faces.astype(np.int64)
    ours = angle_weighted_normals(points, faces, faces, len(points), BLOCKS)
    theirs = trimesh.Trimesh(points, faces, process=False).vertex_normals
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_a_triangulation_of_a_cube_does_not_bend_its_normals():
    # The point of angles as weights: a corner of a cube is symmetric however its sides are cut.
    cube = trimesh.creation.box()
    faces = cube.faces.astype(np.int64)
    normals = angle_weighted_normals(cube.vertices, faces, faces, 8, BLOCKS)
    np.testing.assert_allclose(normals, np.sign(cube.vertices) / np.sqrt(3), atol=1e-12)


@pytest.mark.parametrize("scale", [1e-38, 1e-10, 1.0, 1e38])
def test_normals_do_not_depend_on_the_unit_of_length(scale):
    points = scale * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2]])
    normals = angle_weighted_normals(points, faces, faces, 3, BLOCKS)
    np.testing.assert_allclose(normals, [[0, 0, 1]] * 3, atol=1e-12)


def test_groups_without_area_or_direction_have_none():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    # A line; then a face and its own back.
    for faces in (np.array([[0, 1, 2]]), np.array([[0, 1, 3], [1, 0, 3]])):
        normals = angle_weighted_normals(points, faces, faces, 4, BLOCKS)
        np.testing.assert_array_equal(normals, np.zeros((4, 3)))
