"""An Open3D TriangleMesh comes back as one, with all that it carries."""

import numpy as np
import pytest

from pns_common import loop, subdivide
from tests.support.split_data import EXPECTED, FACES, SCHEME, UV, VERTICES, same_surface, split_uv

# Open3D is large: these are left out where it is absent. `make interop-test` has it.


@pytest.fixture
def mesh():
    open3d = pytest.importorskip("open3d")
    vector, triples = open3d.utility.Vector3dVector, open3d.utility.Vector3iVector
    mesh = open3d.geometry.TriangleMesh(vector(VERTICES), triples(FACES.astype(np.int32)))
    mesh.vertex_colors = vector((VERTICES + 2) / 4)
    mesh.triangle_uvs = open3d.utility.Vector2dVector(UV[FACES].reshape(-1, 2))
    mesh.triangle_material_ids = open3d.utility.IntVector(np.arange(len(FACES), dtype=np.int32))
    mesh.textures = [open3d.geometry.Image(np.zeros((2, 2, 3), dtype=np.uint8))]
    return mesh


def test_the_surface_and_its_data(mesh):
    refined = subdivide(mesh, 2, SCHEME)
    assert type(refined) is type(mesh)
    same_surface(np.asarray(refined.vertices), np.asarray(refined.triangles))
    colours = split_uv((VERTICES + 2) / 4)
    np.testing.assert_allclose(np.asarray(refined.vertex_colors), colours, atol=1e-12)
    uv = split_uv(UV)[EXPECTED.faces].reshape(-1, 2)
    np.testing.assert_allclose(np.asarray(refined.triangle_uvs), uv, atol=1e-12)
    materials = np.asarray(refined.triangle_material_ids)
    np.testing.assert_array_equal(materials, np.repeat(np.arange(len(FACES)), 16))
    assert len(refined.textures) == 1
    assert not refined.has_vertex_normals()


def test_normals_are_computed_where_there_were_some(mesh):
    mesh.compute_vertex_normals()
    assert subdivide(mesh, 1, loop()).has_vertex_normals()
    mesh.vertex_normals.clear()
    refined = subdivide(mesh, 1, loop())
    assert refined.has_triangle_normals()
    assert not refined.has_vertex_normals()


def test_tensors_stay_of_their_type(mesh):
    open3d = pytest.importorskip("open3d")
    given = open3d.t.geometry.TriangleMesh.from_legacy(mesh)
    given.vertex["heat"] = open3d.core.Tensor(VERTICES[:, :1])
    given.compute_vertex_normals()
    refined = subdivide(given, 2, SCHEME)
    assert type(refined) is type(given)
    kinds = [refined.vertex.positions.dtype, refined.triangle.indices.dtype]
    assert kinds == [given.vertex.positions.dtype, given.triangle.indices.dtype]
    np.testing.assert_array_equal(refined.triangle.indices.numpy(), EXPECTED.faces)
    np.testing.assert_allclose(
        refined.vertex.positions.numpy(), EXPECTED.vertices, rtol=1e-5, atol=1e-6
    )
    heat = split_uv(VERTICES[:, :1])
    np.testing.assert_allclose(refined.vertex["heat"].numpy(), heat, atol=1e-12)
    uv = split_uv(UV)[EXPECTED.faces]
    np.testing.assert_allclose(refined.triangle["texture_uvs"].numpy(), uv, atol=1e-6)
    assert refined.vertex["normals"].shape == [len(EXPECTED.vertices), 3]
