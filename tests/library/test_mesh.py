"""Mesh validates once and names the element; clean drops what it says and maps the rest."""

import copy
import pickle
import sys

import numpy as np
import pytest
from hypothesis import given

from pns_common import Mesh, MeshError, clean, loop, refine
from tests.support.meshes import soups
from tests.support.polygons import polygon_soups

POINTS = np.eye(3)
FACE = np.array([[0, 1, 2]])


@pytest.mark.parametrize(
    ("vertices", "faces", "element", "index"),
    [
        (np.zeros((3, 2)), FACE, "vertices", None),
        (np.zeros(3), FACE, "vertices", None),
        (np.array([["a", "b", "c"]] * 3), FACE, "vertices", None),
        (POINTS + 1j, FACE, "vertices", None),
        (POINTS, np.zeros((0, 3), int), "faces", None),
        (POINTS, np.array([[0, 1]]), "face", 0),
        (POINTS, np.array([[0.0, 1.0, 2.0]]), "faces", None),
        (POINTS, np.array([[0, 1, 2], [0, 1, 3]]), "face", 1),
        (POINTS, np.array([[0, -1, 2]]), "face", 0),
        (np.array([[0, 0, 0], [0, np.nan, 0], [1, 1, 1]]), FACE, "vertex", 1),
        (np.array([[0, 0, 0], [0, 1, 0], [1, -np.inf, 1]]), FACE, "vertex", 2),
        (np.array([[1e80, 0, 0], [0, 1, 0], [1, 1, 1]]), FACE, "vertex", 0),
        (1e-80 * POINTS, FACE, "vertices", None),
        ([[0, 0, 0], [1, 0], [0, 1, 0]], FACE, "vertices", None),
        (POINTS, [[0, 1, 2], [0, 1]], "face", 1),
        (POINTS, np.array([[0, 1, 2**64 - 1]], dtype=np.uint64), "face", 0),
        (np.ma.array(POINTS, mask=np.eye(3)), FACE, "vertices", None),
        (POINTS, np.ma.array(FACE, mask=[[0, 1, 0]]), "faces", None),
    ],
)
def test_invalid_input_names_the_element(vertices, faces, element, index):
    with pytest.raises(MeshError) as caught:
        Mesh(vertices, faces)
    assert (caught.value.element, caught.value.index) == (element, index)
    assert element in str(caught.value)
    assert "-1" not in str(caught.value) or np.any(np.asarray(faces) == -1)


def test_mesh_does_not_follow_changes_of_its_input():
    vertices = POINTS.copy()
    mesh = Mesh(vertices, FACE)
    vertices[0] = 7
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 7


@pytest.mark.parametrize("again", [copy.deepcopy, lambda mesh: pickle.loads(pickle.dumps(mesh))])
def test_copies_and_pickles_cannot_be_written_to_either(again):
    mesh = again(Mesh(np.eye(3), np.array([[0, 1, 2]])))
    assert mesh.vertices.tolist() == np.eye(3).tolist()
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 7


def test_single_precision_and_small_indices_become_double_and_int64():
    mesh = Mesh(POINTS.astype(np.float32), FACE.astype(np.uint8))
    assert mesh.vertices.dtype == np.float64
    assert mesh.faces.dtype == np.int64


def test_clean_drops_degenerate_duplicate_and_unused_and_says_so():
    vertices = np.arange(18.0).reshape(6, 3)
    faces = [[1, 2, 3], [2, 2, 3], [3, 1, 2], [3, 2, 1], [1, 3, 5]]
    cleaned = clean(Mesh(vertices, np.array(faces)))
    np.testing.assert_array_equal(cleaned.mesh.vertices, vertices[[1, 2, 3, 5]])
    np.testing.assert_array_equal(cleaned.mesh.faces, [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(cleaned.vertex_map, [-1, 0, 1, 2, -1, 3])
    np.testing.assert_array_equal(cleaned.face_map, [0, -1, -1, -1, 1])
    np.testing.assert_array_equal(cleaned.representative, [0, -1, 0, 0, 1])
    dropped = (cleaned.dropped_degenerate, cleaned.dropped_duplicate, cleaned.dropped_vertices)
    assert dropped == (1, 2, 2)


def test_clean_refuses_a_mesh_of_degenerate_faces():
    with pytest.raises(MeshError, match="degenerate"):
        clean(Mesh(POINTS, np.array([[0, 0, 1]])))


@given(soups())
def test_clean_keeps_each_set_of_three_vertices_once(mesh):
    sets = [frozenset(face) for face in mesh.faces.tolist()]
    proper = {s for s in sets if len(s) == 3}
    if not proper:
        with pytest.raises(MeshError):
            clean(mesh)
        return
    cleaned = clean(mesh)
    back = np.flatnonzero(cleaned.vertex_map >= 0)
    kept = [frozenset(back[face].tolist()) for face in cleaned.mesh.faces]
    assert len(kept) == len(set(kept))
    assert set(kept) == proper
    for old, new in enumerate(cleaned.representative.tolist()):
        assert (new < 0) == (len(sets[old]) < 3)
        assert new < 0 or kept[new] == sets[old]


@given(polygon_soups())
def test_clean_keeps_each_polygon_once(mesh):
    faces = [face.tolist() for face in mesh.polygons]

    def ways(face):
        return {tuple(np.roll(way, k)) for way in (face, face[::-1]) for k in range(len(face))}

    proper = [face for face in faces if len(set(face)) == len(face)]
    firsts = [f for i, f in enumerate(proper) if not any(tuple(f) in ways(g) for g in proper[:i])]
    if not firsts:
        with pytest.raises(MeshError):
            clean(mesh)
        return
    cleaned = clean(mesh)
    back = np.flatnonzero(cleaned.vertex_map >= 0)
    assert [back[face].tolist() for face in cleaned.mesh.polygons] == firsts
    assert cleaned.dropped_degenerate == len(faces) - len(proper)
    assert cleaned.dropped_duplicate == len(proper) - len(firsts)
    for face, new in zip(faces, cleaned.representative.tolist(), strict=True):
        assert (new < 0) == (face not in proper)
        assert new < 0 or tuple(face) in ways(firsts[new])


@pytest.mark.parametrize(
    ("face", "message"),
    [([], "0 corners"), ([3], "1 corners"), ([3, 4], "2 corners"), ([[0], [1, 2]], "lengths")],
)
def test_a_face_of_few_corners_is_named(face, message):
    with pytest.raises(MeshError, match=message):
        Mesh(np.eye(5, 3), [[0, 1, 2], [0, 2, 3, 4], face])


def test_faces_of_any_degree_are_kept_and_named_in_errors():
    points = np.random.default_rng(0).standard_normal((6, 3))
    mesh = Mesh(points, [[0, 1, 2], [0, 2, 3, 4], [0, 4, 5]])
    assert [face.tolist() for face in mesh.polygons] == [[0, 1, 2], [0, 2, 3, 4], [0, 4, 5]]
    assert mesh.offsets.tolist() == [0, 3, 7, 10]
    with pytest.raises(MeshError, match="different degrees"):
        _ = mesh.faces
    quads = Mesh(points, [[0, 1, 2, 3], [0, 3, 4, 5]])
    assert quads.faces.shape == (2, 4)
    assert not quads.triangles
    with pytest.raises(MeshError, match=r"face 1: indices \[0, 2, 3, 9\]"):
        Mesh(points, [[0, 1, 2], [0, 2, 3, 9]])
    with pytest.raises(MeshError, match="expected triangles"):
        refine(quads, loop())


PYRAMID = [[3, 2, 1, 0], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


@pytest.mark.parametrize("ending", ["obj", "ply", "vtk"])
def test_a_saved_mesh_is_loaded_as_it_was(tmp_path, ending):
    pytest.importorskip("meshio")
    points = np.random.default_rng(0).standard_normal((5, 3))
    for faces in (PYRAMID, PYRAMID[1:], PYRAMID[:1]):
        Mesh(points, faces).save(tmp_path / f"mesh.{ending}")
        again = Mesh.load(tmp_path / f"mesh.{ending}")
        np.testing.assert_array_equal(again.vertices, points)
        assert [face.tolist() for face in again.polygons] == faces


def test_an_obj_with_texture_coordinates_is_loaded(tmp_path):
    path = tmp_path / "mesh.OBJ"
    seam = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 2 2"
    path.write_text(
        f"# a sheet\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n{seam}\nf 1/1 2/2 3/3\nf -4/5 -2//1 -1\n"
    )
    mesh = Mesh.load(path)
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3]])
    path.write_text("v 0 0 0\nf 1 two 3\n")
    with pytest.raises(MeshError, match=r"line 2: .*two"):
        Mesh.load(path)


def test_a_file_that_meshio_cannot_read_is_named(tmp_path, monkeypatch):
    pytest.importorskip("meshio")
    (tmp_path / "mesh.glb").write_bytes(b"glTF")
    with pytest.raises(MeshError, match=r"mesh\.glb.*`pns subdivide` may"):
        Mesh.load(tmp_path / "mesh.glb")
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(ImportError, match="pip install meshio"):
        Mesh.load(tmp_path / "mesh.ply")


def test_a_saved_file_is_read_by_others(tmp_path):
    pytest.importorskip("meshio")
    trimesh = pytest.importorskip("trimesh")
    mesh = Mesh(np.random.default_rng(0).standard_normal((5, 3)), PYRAMID).triangulated()
    for ending in ("obj", "ply", "stl", "off"):
        mesh.save(tmp_path / f"mesh.{ending}")
        read = trimesh.load_mesh(tmp_path / f"mesh.{ending}", process=False)
        np.testing.assert_allclose(read.triangles, mesh.vertices[mesh.faces], atol=1e-6)


@pytest.mark.parametrize("ending", ["stl", "off"])
def test_polygons_are_not_lost_in_files_of_triangles(tmp_path, ending):
    with pytest.raises(MeshError, match=r"triangulated\(\)"):
        Mesh(np.eye(5, 3), PYRAMID).save(tmp_path / f"mesh.{ending}")
    assert not any(tmp_path.iterdir())


def test_a_polygon_is_cut_from_its_first_corner():
    angles = np.arange(5) * 2 * np.pi / 5
    points = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    mesh = Mesh(points, [[1, 2, 3, 4, 0]])
    assert mesh.triangulated().faces.tolist() == [[1, 2, 3], [1, 3, 4], [1, 4, 0]]
    pyramid = Mesh(np.eye(5, 3), PYRAMID).triangulated()
    assert pyramid.faces.tolist() == [[3, 2, 1], [3, 1, 0], *PYRAMID[1:]]
    assert pyramid.triangulated() is pyramid
