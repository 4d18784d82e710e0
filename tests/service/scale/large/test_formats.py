"""Files in and out: what `pns subdivide` reads, parts that meet, and broken files that are told."""

import io
import json
import shutil
import struct
import subprocess

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from pns_common import Mesh, clean, loop, refine
from pns_common.mesh import repeated_vertex
from service.errors import InvalidParameter, UnreadableError, UnrefinableError
from service.gltf.read.container import read_glb, write_glb
from service.meshes.weld import weld
from service.meshfiles import formats
from service.meshfiles.example import part_glb
from service.meshfiles.mesh_file import of_triangles
from service.meshfiles.triangles_glb import triangles_glb
from service.options import Options
from service.scale.large import weld as outside_memory
from service.scale.large.plan import Large
from service.scale.large.run import run_large
from service.scale.large.weld import weld_outside_memory
from tests.service.scale.large.parts import here
from tests.support.meshes import bent, grid, soups

LOOP = Options(scheme="loop")


def refined(source, output, parts=3, options=LOOP):
    large = Large(source, output, options, 2**31, parts)
    report, _ = run_large(large, here, Console(file=io.StringIO()))
    return report


def loose_triangles():
    """Triangles with seams: each corner of a surface, some repeated, one without area."""
    points, faces = grid(8, bent)
    faces = np.concatenate([faces, faces[:2, ::-1], [[3, 3, 4]]])
    return of_triangles(points[faces.reshape(-1)], np.arange(faces.size).reshape(-1, 3))


def written(path, triangles):
    kind = path.suffix[1:]
    data = triangles_glb(triangles) if kind == "glb" else formats.write(triangles, kind)
    path.write_bytes(data)
    return path


def control_of(vertices, faces):
    """The control mesh that is made in memory."""
    welded = weld(vertices, faces)
    return clean(Mesh(welded.points, welded.faces)).mesh


def assert_same(folder, mesh):
    points, faces = np.load(folder / "positions.npy"), np.load(folder / "faces.npy")
    assert points.tobytes() == mesh.vertices.tobytes()
    assert (faces == mesh.faces).all()


@pytest.mark.parametrize("ending", ["ply", "stl", "obj", "glb"])
def test_files_are_refined_as_in_memory(tmp_path, ending):
    source = written(tmp_path / f"in.{ending}", loose_triangles())
    report = refined(source, tmp_path / "out")
    as_stl = formats.read(formats.write(loose_triangles(), "stl"), "stl")
    read = formats.read(source.read_bytes(), ending) if ending != "glb" else as_stl
    assert_same(tmp_path / "out", refine(control_of(read.vertices, read.faces), loop()).mesh)
    assert (report["dropped"]["degenerate_faces"], report["dropped"]["duplicate_faces"]) == (1, 2)


@settings(max_examples=25)
@given(mesh=soups(), rows=st.integers(1, 50))
def test_welding_outside_memory_is_welding(tmp_path_factory, mesh, rows):
    folder = tmp_path_factory.mktemp("weld")
    vertices = np.round(mesh.vertices / np.abs(mesh.vertices).max() * 2)  # many meet, some at −0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outside_memory, "SORTED", rows)
        patch.setattr(
            outside_memory,
            "blocks_of",
            lambda count: (
                slice(start, min(start + rows, count)) for start in range(0, count, rows)
            ),
        )
        if repeated_vertex(weld(vertices, mesh.faces).faces).all():
            with pytest.raises(UnrefinableError, match="three different"):
                weld_outside_memory(vertices, mesh.faces, folder)
            return
        weld_outside_memory(vertices, mesh.faces, folder)
    assert_same(folder, control_of(vertices, mesh.faces))
    assert sorted(path.name for path in folder.iterdir()) == ["faces.npy", "positions.npy"]


def test_what_many_vertices_share_is_never_held_at_once(tmp_path, monkeypatch):
    """Three positions and two faces, a thousand times each."""
    held = []

    def watched(rows, width):
        held.append(len(rows))
        return in_order(rows, width)

    in_order = outside_memory._sorted
    monkeypatch.setattr(outside_memory, "_sorted", watched)
    monkeypatch.setattr(
        outside_memory,
        "blocks_of",
        lambda count: (slice(at, min(at + 500, count)) for at in range(0, count, 500)),
    )
    points = np.tile(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), (1000, 1))
    faces = np.arange(4000).reshape(-1, 4)[:, [0, 1, 2, 0, 1, 3]].reshape(-1, 3)
    dropped = weld_outside_memory(points, faces, tmp_path)
    assert_same(tmp_path, control_of(points, faces))
    assert dropped == outside_memory.Dropped(0, 1998, 3996)
    assert max(held) <= 4 * len(points) // 500


def test_an_obj_may_count_backwards_and_name_other_things(tmp_path, monkeypatch):
    monkeypatch.setattr("service.scale.large.readers.TEXT", 32)
    text = b"# a\nmtllib x\nv 0 0 0\nv 1 0 0 1\n v 0 1 0\r\nvt 0 0\nf -3/1/1 -2//1 -1 # f 9\n"
    (tmp_path / "in.obj").write_bytes(text + b"v 0 0 1\nf 1 2 4\ng x\n")
    refined(tmp_path / "in.obj", tmp_path / "out", 1)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    expected = refine(Mesh(points, np.array([[0, 1, 2], [0, 1, 3]])), loop()).mesh
    assert_same(tmp_path / "out", expected)


def test_an_obj_may_begin_with_a_mark_of_its_encoding(tmp_path):
    text = b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n"
    (tmp_path / "in.obj").write_bytes(text)
    refined(tmp_path / "in.obj", tmp_path / "out", 1)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    expected = refine(Mesh(points, np.array([[0, 1, 2], [0, 1, 3]])), loop()).mesh
    assert_same(tmp_path / "out", expected)


def test_an_obj_s_lines_may_end_with_carriage_returns(tmp_path, monkeypatch):
    monkeypatch.setattr("service.scale.large.readers.TEXT", 32)
    text = b"# a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1 # f 9\nv 0 0 1\nf 1 2 4\n"
    (tmp_path / "in.obj").write_bytes(text.replace(b"\n", b"\r"))
    refined(tmp_path / "in.obj", tmp_path / "out", 1)
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    expected = refine(Mesh(points, np.array([[0, 1, 2], [0, 1, 3]])), loop()).mesh
    assert_same(tmp_path / "out", expected)


@pytest.mark.parametrize("short", [b"v 1 0", b"v 1 # 0 0", b"v "])
def test_an_obj_s_vertex_without_three_coordinates_is_refused(tmp_path, short):
    """Passed over, it would leave its number to the next one."""
    text = b"v 0 0 0\n" + short + b"\nv 0 1 0\nv 0 0 1\nv 1 1 1\nf 1 2 3\n"
    (tmp_path / "in.obj").write_bytes(text)
    with pytest.raises(UnrefinableError, match=r"coordinates .*nan"):
        refined(tmp_path / "in.obj", tmp_path / "out", 1)


def stl_text(spelled=str):
    return spelled(trimesh.Trimesh(*grid(3), process=False).export(file_type="stl_ascii"))


@pytest.mark.parametrize(
    "spelled",
    [
        str,
        str.upper,
        lambda text: text.replace("\n", "\r"),
        lambda text: text.replace("outer loop\n", "outer loop "),
    ],
)
def test_an_stl_may_be_text(tmp_path, monkeypatch, spelled):
    monkeypatch.setattr("service.scale.large.readers.TEXT", 400)
    (tmp_path / "in.stl").write_text(stl_text(spelled))
    refined(tmp_path / "in.stl", tmp_path / "out", 2)
    assert_same(tmp_path / "out", refine(control_of(*grid(3)), loop()).mesh)


@pytest.mark.parametrize("place", ["endloop", "facet", "endsolid"])
def test_an_stl_s_text_that_is_cut_off_is_told(tmp_path, place):
    text = stl_text()
    (tmp_path / "in.stl").write_text(text[: text.rindex(place)])
    with pytest.raises(UnreadableError, match="ends within a solid"):
        refined(tmp_path / "in.stl", tmp_path / "out", 2)


def test_a_ply_may_be_of_either_byte_order_with_other_properties(tmp_path):
    points, faces = grid(4, bent)
    header = [
        "ply",
        "format binary_big_endian 1.0",
        "comment made by hand",
        "element vertex 16",
        *(f"property double {name}" for name in ("x", "y", "quality", "z")),
        "element camera 1",
        "property int number",
        f"element face {len(faces)}",
        "property list uchar ushort vertex_index",
        "property float area",
        "end_header",
    ]
    with (tmp_path / "in.ply").open("wb") as file:
        file.write(("\n".join(header) + "\n").encode())
        for x, y, z in points:
            file.write(struct.pack(">4d", x, y, 7.0, z))
        file.write(struct.pack(">i", 5))
        for face in faces:
            file.write(struct.pack(">B3Hf", 3, *face, 1.5))
    report = refined(tmp_path / "in.ply", tmp_path / "out", 2)
    assert [(change["count"], change["what"]) for change in report["changes"]] == [
        (16, "vertex property quality dropped"),
        (1, "element camera dropped"),
        (len(faces), "face property area dropped"),
    ]
    assert_same(tmp_path / "out", refine(control_of(points, faces), loop()).mesh)


def test_a_ply_that_is_written_holds_what_the_arrays_hold(tmp_path):
    source = written(tmp_path / "in.obj", loose_triangles())
    refined(source, tmp_path / "out.ply")
    refined(source, tmp_path / "out")
    read = formats.read((tmp_path / "out.ply").read_bytes(), "ply")
    assert_same(tmp_path / "out", Mesh(read.vertices, read.faces))
    refined(tmp_path / "out.ply", tmp_path / "again")


def test_parts_of_a_tileset_meet_in_bits(tmp_path):
    source = written(tmp_path / "in.obj", loose_triangles())
    report = refined(source, tmp_path / "out.3dtiles", 5)
    refined(source, tmp_path / "out")
    tree = json.loads((tmp_path / "out.3dtiles" / "tileset.json").read_text())
    x, minus_z, y = tree["root"]["transform"][12:15]
    points, faces = np.load(tmp_path / "out/positions.npy"), np.load(tmp_path / "out/faces.npy")
    expected = (points - [x, y, -minus_z]).astype(np.float32)
    tiles = [
        trimesh.load(
            tmp_path / "out.3dtiles" / child["content"]["uri"], process=False, force="mesh"
        )
        for child in tree["root"]["children"]
    ]
    corners = np.concatenate([tile.vertices[tile.faces] for tile in tiles]).astype(np.float32)
    assert sorted(corners.tolist()) == sorted(expected[faces].tolist())
    assert tree["asset"]["extras"]["pns"]["levels"] == report["levels"]
    for tile, child in zip(tiles, tree["root"]["children"], strict=True):
        box = np.array(child["boundingVolume"]["box"])
        turned = np.stack([tile.vertices[:, 0], -tile.vertices[:, 2], tile.vertices[:, 1]], axis=1)
        inside = np.abs(turned - box[:3]) <= np.abs(box[3:]).reshape(3, 3).sum(axis=0) + 1e-6
        assert inside.all()


def test_a_tileset_is_valid(tmp_path):
    validator = shutil.which("3d-tiles-validator")
    if validator is None:
        pytest.skip("3d-tiles-validator is not installed (npm)")
    refined(written(tmp_path / "in.stl", loose_triangles()), tmp_path / "out.3dtiles", 4)
    arguments = [validator, "--tilesetFile", str(tmp_path / "out.3dtiles" / "tileset.json")]
    told = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    report = json.loads(told[told.index("{") :])
    assert (report["numErrors"], report["numWarnings"]) == (0, 0), told


def changed_glb(change):
    container = read_glb(triangles_glb(of_triangles(*grid(3))))
    tree = json.loads(container.text)
    change(tree)
    return write_glb(json.dumps(tree).encode(), [container.binary], [])


def _two_meshes(tree):
    tree["meshes"] *= 2


def _lines(tree):
    tree["meshes"][0]["primitives"][0]["mode"] = 1


def _bytes(tree):
    tree["accessors"][0]["componentType"] = 5121


def _elsewhere(tree):
    tree["buffers"][0]["uri"] = "x"


def _past_its_view(tree):
    tree["accessors"][0]["byteOffset"] = 4


def _before_its_view(tree):
    tree["accessors"][0]["byteOffset"] = -4


def _no_bytes(tree):
    del tree["accessors"][0]["bufferView"]


def _compressed(tree):
    tree["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {}}


def _five_corners(tree):
    indices = tree["meshes"][0]["primitives"][0]["indices"]
    tree["accessors"][indices]["count"] = 5


PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\n"
FACE = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
STL = b"solid\nfacet normal 0 0 0\nouter loop\n%b\nendloop\nendfacet\nendsolid\n"
XYZ = b"property float y\nproperty float z\n"


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.ply", b"no ply", "not a PLY"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "only a binary"),
        ("a.ply", PLY + b"end_header\n", "no vertices or no faces"),
        ("a.ply", PLY + FACE, "vertex has no"),
        ("a.ply", PLY + XYZ.replace(b"float z", b"real z") + FACE, "line 6 of the PLY header"),
        ("a.ply", PLY + XYZ + b"property list uchar int w\n" + FACE, "w' of vertex"),
        ("a.ply", PLY + XYZ + FACE, "ends within its vertex"),
        ("a.ply", PLY + XYZ + FACE + bytes(12) + b"\4" + bytes(16), "face 0 has 4 corners"),
        ("a.ply", PLY + XYZ + FACE + bytes(12) + struct.pack("<B3i", 3, 0, 1, 2), "indices"),
        ("a.stl", b"solid\nvertex 0 0 0\n", "no faces as text"),
        ("a.stl", STL % b"vertex 0 0 0", "no triangle"),
        ("a.stl", STL % (4 * b"vertex 0 0 0\n"), "no triangle"),
        ("a.stl", b"", "no whole binary STL"),
        ("a.stl", bytes(80) + struct.pack("<I", 9) + bytes(50 * 8), "no whole binary STL"),
        ("a.stl", STL % b"vertex 0 0 x vertex 1 0 0 vertex 0 1 0", "no number"),
        ("a.obj", b"v 0 0 0\nf 1 2 3 4\n", "4 corners"),
        ("a.obj", b"v 0 0 zero\n", "no number"),
        ("a.obj", b"v 0 0 0\nf 1 x 3\n", "no number"),
        ("a.obj", b"v 0 0 0\nf 1 1_0 3\n", "no number"),
        ("a.obj", b"v 0 0 1_0\n", "no number"),
        ("a.obj", b"v 0 0 0\nf 1 1 1\n", "three different"),
        ("a.glb", b"no glb" * 9, "GLB magic"),
        ("a.glb", b"x", "shorter than a GLB header"),
        ("a.glb", changed_glb(_two_meshes), "2 meshes"),
        ("a.glb", changed_glb(_lines), "plain, uncompressed"),
        ("a.glb", changed_glb(_bytes), "float32"),
        ("a.glb", changed_glb(_elsewhere), "did not come with"),
        ("a.glb", changed_glb(_past_its_view), "ends? at byte .* /accessors/0"),
        ("a.glb", changed_glb(_before_its_view), "/accessors/0/byteOffset"),
        ("a.glb", changed_glb(_no_bytes), "plain, uncompressed"),
        ("a.glb", changed_glb(_compressed), "compressed buffer views"),
        ("a.glb", changed_glb(_five_corners), "5 corners"),
        ("a.glb", changed_glb(lambda tree: tree.pop("meshes")), "0 meshes"),
        ("a.fbx", b"", "must be a folder"),
    ],
)
def test_files_that_cannot_be_read_are_told(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises((UnreadableError, UnrefinableError, InvalidParameter), match=words):
        refined(tmp_path / name, tmp_path / "out", 1)
    assert not (tmp_path / "out").exists()


def _variants(tree):
    mappings = {"KHR_materials_variants": {"mappings": []}}
    tree["meshes"][0]["primitives"][0]["extensions"] = mappings


def _placed(tree):
    tree["nodes"] = [
        {"children": [1], "scale": [2, 2, 2]},
        {"children": [2], "translation": [1, 0, 0]},
        {"mesh": 0, "scale": [1.0, 1.0, 1.0]},
    ]


def _packed(tree):
    tree["bufferViews"][0]["byteStride"] = 0


@pytest.mark.parametrize("change", [_variants, _packed])
def test_what_does_not_touch_the_bytes_of_a_glb_is_passed_over(tmp_path, change):
    for name, data in (("plain", changed_glb(dict)), ("changed", changed_glb(change))):
        (tmp_path / f"{name}.glb").write_bytes(data)
        refined(tmp_path / f"{name}.glb", tmp_path / name, 1)
    for array in ("positions.npy", "faces.npy"):
        first, other = (tmp_path / name / array for name in ("plain", "changed"))
        assert first.read_bytes() == other.read_bytes()


def test_what_a_file_holds_beside_its_faces_is_told(tmp_path):
    (tmp_path / "in.glb").write_bytes(part_glb())
    stl = formats.write(loose_triangles(), "stl")
    (tmp_path / "in.stl").write_bytes(stl[:-2] + b"\xff\x7f")
    told = {
        ending: [f"{change['count']} {change['what']}" for change in report["changes"]]
        for ending in ("glb", "stl")
        if (report := refined(tmp_path / f"in.{ending}", tmp_path / ending, 1))
    }
    primitives = json.loads(read_glb(part_glb()).text)["meshes"][0]["primitives"]
    assert told["glb"] == [
        f"{sum(name in each['attributes'] for each in primitives)} attribute {name} dropped"
        for name in ("NORMAL", "TEXCOORD_0")
    ]
    assert told["stl"] == ["1 colours of faces dropped"]
    (tmp_path / "in.glb").write_bytes(changed_glb(_placed))
    (change,) = refined(tmp_path / "in.glb", tmp_path / "placed", 1)["changes"]
    assert (change["what"], change["count"]) == ("transforms of nodes dropped", 2)


def test_a_glb_of_several_primitives_is_one_mesh(tmp_path):
    (tmp_path / "in.glb").write_bytes(part_glb())
    refined(tmp_path / "in.glb", tmp_path / "out", 2)
    scene = trimesh.load(tmp_path / "in.glb", process=False)
    parts = list(scene.geometry.values())
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate([p.faces + s for p, s in zip(parts, starts, strict=False)])
    vertices = np.concatenate([part.vertices for part in parts])
    assert_same(tmp_path / "out", refine(control_of(vertices, faces), loop()).mesh)
