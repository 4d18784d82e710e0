"""Dense meshes that files hold."""

import numpy as np
import pytest
import trimesh

from pns_common import MeshError
from tests.support.meshes import bumpy_sphere, icosphere
from train.data.dense_meshes import (
    is_manifold,
    largest_part,
    read_mesh,
)
from train.data.validation import coarse_mesh, read_shape, validation_meshes


def write(path, *shapes):
    """Write meshes as parts of one file."""
    scene = trimesh.Scene([trimesh.Trimesh(*shape, process=False) for shape in shapes])
    scene.export(path)
    return path


def moved(shape, offset):
    return shape[0] + np.array(offset), shape[1]


def torn(shape):
    """Every face with three vertices of its own."""
    vertices, faces = shape
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


SPHERE = bumpy_sphere(subdivisions=3)  # 1280 faces


def test_a_file_is_welded_by_position(tmp_path):
    mesh = read_mesh(write(tmp_path / "torn.ply", torn(SPHERE)))
    assert len(mesh.vertices) == len(SPHERE[0])
    assert is_manifold(mesh)


def test_the_largest_part_is_taken(tmp_path):
    small = moved(icosphere(1), (5, 0, 0))
    part = largest_part(read_mesh(write(tmp_path / "two.glb", small, SPHERE)))
    assert len(part.faces) == len(SPHERE[1])
    assert np.abs(part.vertices).max() < 2


@pytest.mark.parametrize("content", [b"", b"PK\3\4", b"no arrays"])
def test_an_archive_of_arrays_that_is_none_is_told(tmp_path, content):
    path = tmp_path / "mesh.npz"
    path.write_bytes(content)
    with pytest.raises(MeshError, match="cannot be read"):
        read_mesh(path)
    np.savez(path, vertices=SPHERE[0])
    with pytest.raises(MeshError, match="cannot be read"):
        read_mesh(path)


@pytest.mark.parametrize("content", ["glTF, but no more", "v 0 0 0\n"])
def test_a_file_without_triangles_is_refused(tmp_path, content):
    path = tmp_path / "mesh.obj"
    path.write_text(content)
    with pytest.raises(MeshError):
        read_mesh(path)


def test_meshes_of_ones_own_validate(tmp_path):
    """`dense.csv` lists them; parts have the sharp edges that turn enough."""
    write(tmp_path / "ball.ply", SPHERE)
    box = trimesh.creation.box().subdivide().subdivide().subdivide().subdivide()
    write(tmp_path / "box.obj", (box.vertices, box.faces))
    listed = "file,kind\nball.ply,scan\nbox.obj,part\nabsent.stl,part\n"
    (tmp_path / "dense.csv").write_text(listed)
    drawn = validation_meshes(tmp_path)
    assert {each.path.name for each in drawn} == {"ball.ply", "box.obj"}
    shapes = {each.path.name: read_shape(each.path, each.kind) for each in drawn}
    assert shapes["ball.ply"].sharp is None
    ends = shapes["box.obj"].sharp
    assert np.isclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum(), 12)
    coarse = coarse_mesh(shapes["ball.ply"], drawn[0])
    assert coarse is not None
    assert len(coarse.faces) <= 640
