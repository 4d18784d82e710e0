"""Normals of groups of corners: the bits of the array kernels, whoever makes them."""

import numpy as np
import pytest

from pns_common.base.blocks import Blocks
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import corner_normals
from pns_common.geometry import corner_normals as arrays
from tests.support.meshes import bumpy_sphere, grid

MESHES = {
    "closed": bumpy_sphere(0, subdivisions=2),
    "open": grid(4),
    "column by column": tuple(map(np.asfortranarray, grid(4))),
    "no area": (np.zeros((3, 3)), np.array([[0, 1, 2]])),
}


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("index", [np.int32, np.int64])
@pytest.mark.parametrize("name", MESHES)
def test_normals_have_the_bits_of_the_arrays(name, index, loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(corner_normals, "kernels_loaded", lambda: loaded)
    points, faces = MESHES[name]
    # One group has no corner.
    groups = np.random.default_rng(0).integers(0, 7, faces.shape)
    expected = arrays.angle_weighted_normals(points, faces, groups, 8, Blocks(1, rows=5))
    given = points, faces.astype(index), groups.astype(index), 8
    made = corner_normals.angle_weighted_normals(*given, Blocks(threads=2, rows=7))
    np.testing.assert_array_equal(made, expected)
    assert made.flags.c_contiguous


@pytest.mark.parametrize("loaded", [False, True])
def test_faces_cut_into_triangles_have_the_normals_of_these(loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(corner_normals, "kernels_loaded", lambda: loaded)
    points, triangles = np.random.default_rng(1).random((30, 3)), np.array([[0, 1, 3], [3, 1, 2]])
    faces, groups = np.random.default_rng(2).integers(0, [[[30]], [[9]]], (2, 40, 4))
    cut, of_cut = (of_points[:, triangles].reshape(-1, 3) for of_points in (faces, groups))
    expected = arrays.angle_weighted_normals(points, cut, of_cut, 9, Blocks(1))
    blocks = Blocks(threads=2, rows=4)
    made = corner_normals.angle_weighted_normals(points, faces, groups, 9, blocks, triangles)
    np.testing.assert_array_equal(made, expected)
