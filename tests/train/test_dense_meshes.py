"""Dense meshes that files hold."""

import numpy as np
import pytest
import trimesh

from pns_common import Mesh, MeshError, loop, refine
from tests.support.meshes import bow_tie, bumpy_sphere, grid, icosphere, one_way_pair, three_pages
from tests.support.shared import shared_path
from train.data.dense_meshes import (
    ASSET,
    CAD,
    CONTROL,
    FEWEST_FACES,
    DenseMesh,
    LeftOut,
    asset_meshes,
    cad_meshes,
    dense_asset,
    is_manifold,
    largest_part,
    read_mesh,
    welded,
)


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
    dense = dense_asset(write(tmp_path / "torn.ply", torn(SPHERE)))
    assert dense.kind == ASSET
    assert dense.name == "torn.ply"
    assert dense.title == "torn"
    assert len(dense.mesh.vertices) == len(SPHERE[0])
    assert is_manifold(dense.mesh)


def test_the_largest_part_is_taken(tmp_path):
    small = moved(icosphere(1), (5, 0, 0))
    dense = dense_asset(write(tmp_path / "two.glb", small, SPHERE))
    assert len(dense.mesh.faces) == len(SPHERE[1])
    assert np.abs(dense.mesh.vertices).max() < 2


def test_parts_of_several_primitives_are_joined(tmp_path):
    """Materials split a mesh; the halves' common border has the same positions."""
    vertices, faces = SPHERE
    upper = vertices[faces].mean(axis=1)[:, 2] > 0
    dense = dense_asset(
        write(tmp_path / "split.glb", (vertices, faces[upper]), (vertices, faces[~upper]))
    )
    assert len(dense.mesh.faces) == len(faces)


def test_a_control_mesh_is_subdivided_three_times(tmp_path):
    dense = dense_asset(write(tmp_path / "blob_control_mesh.ply", bumpy_sphere()))
    assert dense.kind == CONTROL
    assert dense.title == "blob"
    assert len(dense.mesh.faces) == 80 * 4**3


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (icosphere(2), ": 320"),
        (grid(40), "plane"),
        (one_way_pair(), ": 1"),
        ((SPHERE[0], np.concatenate([SPHERE[1], SPHERE[1][:1]])), None),
    ],
    ids=["small", "flat", "two parts", "a face twice"],
)
def test_what_is_left_out_has_a_reason(tmp_path, shape, reason):
    read = dense_asset(write(tmp_path / "it.ply", shape))
    if reason is None:
        assert isinstance(read, DenseMesh)
    else:
        assert isinstance(read, LeftOut)
        assert read.name == "it.ply"
        assert reason in read.reason


def test_a_moebius_band_is_no_manifold_here(tmp_path):
    """It has no two sides: somewhere two faces run along their edge in the same direction."""
    count, half = 300, np.pi / 300
    angle = 2 * half * np.arange(count)
    across = np.array([-0.3, 0, 0.3])[None, :, None]
    radial = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)[:, None]
    tilt = np.cos(angle / 2)[:, None, None] * radial
    tilt = tilt + np.sin(angle / 2)[:, None, None] * np.array([0, 0, 1.0])
    points = radial + across * tilt
    i, j = (axis.ravel() for axis in np.mgrid[:count, :2])
    after = (i + 1) % count
    # After a whole turn the band's sides are exchanged.
    last = after == 0
    j0, j1 = np.where(last, 2 - j, j), np.where(last, 1 - j, j + 1)
    v00, v01, v10, v11 = 3 * i + j, 3 * i + j + 1, 3 * after + j0, 3 * after + j1
    faces = np.concatenate([np.stack([v00, v10, v11], 1), np.stack([v00, v11, v01], 1)])
    read = dense_asset(write(tmp_path / "band.ply", (points.reshape(-1, 3), faces)))
    assert isinstance(read, LeftOut)
    assert "manifold" in read.reason


def test_broken_and_empty_files_are_left_out(tmp_path):
    (tmp_path / "noise.glb").write_bytes(b"glTF, but no more")
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    (tmp_path / "points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n"
    )
    read = list(asset_meshes(tmp_path))
    assert [entry.name for entry in read] == ["empty.obj", "noise.glb", "points.ply"]
    assert all(isinstance(entry, LeftOut) and entry.reason for entry in read)


def test_a_folder_is_read_by_name_and_not_deeper(tmp_path):
    (tmp_path / "deeper").mkdir()
    write(tmp_path / "deeper" / "c.ply", SPHERE)
    write(tmp_path / "B.ply", SPHERE)
    write(tmp_path / "a.glb", SPHERE)
    (tmp_path / "list.csv").write_text("no,mesh\n")
    assert [entry.name for entry in asset_meshes(tmp_path)] == ["a.glb", "B.ply"]


def test_manifolds_are_told_from_the_rest():
    assert is_manifold(Mesh(*icosphere()))
    assert is_manifold(Mesh(*grid()))
    for shape in (bow_tie(), three_pages(), one_way_pair()):
        assert not is_manifold(Mesh(*shape))
    vertices, faces = icosphere()
    assert not is_manifold(Mesh(np.concatenate([vertices, [[9, 9, 9]]]), faces))


def test_parts_are_cut_where_three_faces_meet():
    assert len(largest_part(Mesh(*three_pages())).faces) == 1
    assert len(largest_part(Mesh(*bow_tie())).faces) == 1


def test_welding_knows_one_zero_and_refuses_nothing_left():
    joined = welded(Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0]], [[0, 1, 2], [3, 2, 1]]))
    assert len(joined.vertices) == 3
    with pytest.raises(MeshError):
        welded(Mesh([[0.0, 0, 0], [0, 0, 0], [0, 1, 0]], [[0, 1, 2]]))


def test_cad_parts_are_in_the_test_as_they_are():
    parts = cad_meshes()
    assert {part.kind for part in parts} == {CAD}
    assert all(is_manifold(part.mesh) for part in parts)


def test_the_dense_shared_meshes_are_taken():
    read = list(asset_meshes(shared_path("assets")))
    taken = {entry.title: entry for entry in read if isinstance(entry, DenseMesh)}
    assert set(taken) == {
        *("AnimatedMorphSphere", "cow", "frostAxe", "fuze", "Knight"),
        *("fish", "penguin", "spot"),
    }
    for entry in taken.values():
        assert len(entry.mesh.faces) >= FEWEST_FACES
        assert is_manifold(entry.mesh)
    path = shared_path("assets/spot_control_mesh.obj")
    control = trimesh.load_mesh(path, process=False, skip_materials=True)
    again = refine(welded(Mesh(control.vertices, control.faces)), loop(), 3).mesh
    np.testing.assert_allclose(
        np.sort(taken["spot"].mesh.vertices, axis=0), np.sort(again.vertices, axis=0), atol=1e-12
    )


@pytest.mark.parametrize("content", [b"", b"PK\3\4", b"no arrays"])
def test_an_archive_of_arrays_that_is_none_is_told(tmp_path, content):
    path = tmp_path / "mesh.npz"
    path.write_bytes(content)
    with pytest.raises(MeshError, match="cannot be read"):
        read_mesh(path)
    np.savez(path, vertices=SPHERE[0])
    with pytest.raises(MeshError, match="cannot be read"):
        read_mesh(path)
