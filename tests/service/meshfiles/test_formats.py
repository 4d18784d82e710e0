"""OBJ, PLY, STL, OFF and 3MF: what goes in comes out, refined, with nothing cracked or invented."""

import struct

import numpy as np
import pytest
import trimesh

from pns_common.operator.scheme import loop
from service.bodies import media
from service.errors import LimitError, UnreadableError
from service.meshfiles import formats
from service.meshfiles.example import part
from service.meshfiles.mesh_file import COLOUR, NORMAL, UV, of_triangles
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.meshfiles.triangulate import triangulated
from service.options import Limits, Options
from tests.support.memory import most_of
from tests.support.shared import shared_path

KINDS = sorted(set(media.KINDS) - set(media.GLTF_KINDS))
SQUARE = ("0 0 0", "1 0 0", "1 1 0", "0 1 0")


def refined(mesh_file, **options):
    chosen = Options(**{"levels": 1, "scheme": "loop"} | options)
    return refine_mesh_file(mesh_file, loop(), chosen, Limits())


def uv_of(mesh_file):
    layer = mesh_file.layers[UV]
    return layer.values[layer.rows].reshape(-1, 3, 2)


def told(mesh_file):
    return {change.what: change.count for change in mesh_file.changes}


def welded(mesh_file):
    mesh = trimesh.Trimesh(mesh_file.vertices, mesh_file.faces, process=False)
    mesh.merge_vertices()
    return mesh


@pytest.mark.parametrize("kind", KINDS)
def test_written_and_read_again_is_the_same_surface(kind):
    mesh_file = part()
    again = formats.read(formats.write(mesh_file, kind), kind)
    assert len(again.faces) == len(mesh_file.faces)
    np.testing.assert_allclose(
        again.vertices[again.faces], mesh_file.vertices[mesh_file.faces], rtol=1e-6, atol=1e-7
    )
    assert again.changes == ()
    if kind in formats.OF_TRIANGLES:
        assert again.layers == {}
    else:
        np.testing.assert_allclose(uv_of(again), uv_of(mesh_file), atol=1e-6)


def test_an_stl_of_many_solids_is_the_same_surface_as_one_of_few():
    whole = formats.read(formats.write(part(), "stl"), "stl")
    facets = [
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
        + "endloop\nendfacet\n"
        for corners in whole.vertices[whole.faces]
    ]
    solids = "".join(f"solid a part\r\n{facet}endsolid a part\r\n" for facet in 11 * facets)
    read = formats.read(solids.encode(), "stl")
    assert len(read.faces) == 11 * len(facets) > 20_000
    assert np.array_equal(read.vertices[read.faces[: len(facets)]], whole.vertices[whole.faces])


def test_seams_make_no_difference_to_the_surface():
    mesh_file = part()
    fine, _ = refined(mesh_file, levels=2)
    bare, _ = refined(of_triangles(mesh_file.vertices, mesh_file.faces), levels=2)
    assert np.array_equal(fine.vertices[fine.faces], bare.vertices[bare.faces])


CUT = "triangles added by cutting polygons"
TRIANGLE = b"0 0 0\n1 0 0\n0 1 0\n"
POLYGONS = {
    "obj": b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 2 0\nf 1 2 3 4\nf 1 3 5\nf 1 2 3 5 4\n",
    "off": b"# comment\nOFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n.5 2 0\n"
    b"4 0 1 2 3 255 0 0\n3 0 2 4\n5 0 1 2 4 3\n",
    "ply": b"ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n.5 2 0\n4 0 1 2 3\n3 0 2 4\n5 0 1 2 4 3\n",
}


@pytest.mark.parametrize("count", [0, 1])
def test_elements_that_a_ply_has_none_of_are_not_told(count):
    edge = b"element edge %d\nproperty int vertex1\nend_header" % count
    data = POLYGONS["ply"].replace(b"end_header", edge) + b"0\n" * count
    lost = {"element edge dropped": 1} if count else {}
    assert told(formats.read(data, "ply")) == lost | {CUT: 3}


@pytest.mark.parametrize("kind", POLYGONS)
def test_polygons_are_split_and_counted(kind):
    mesh_file = formats.read(POLYGONS[kind], kind)
    assert len(mesh_file.faces) == 2 + 1 + 3
    lost = {"colours of faces dropped": 3} if kind == "off" else {}
    assert told(mesh_file) == lost | {CUT: 3}
    _, report = refined(mesh_file)
    assert {"pointer": "", "code": "polygons-cut", "what": CUT, "count": 3} in report["changes"]


def magics(*attributes):
    """An STL of as many facets, with a colour of the part in its header."""
    facet = np.array([[0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0]], "<f4").tobytes()
    head = b"COLOR=\xff\x00\x00\xff".ljust(80) + struct.pack("<I", len(attributes))
    return head + b"".join(facet + struct.pack("<H", value) for value in attributes)


@pytest.mark.parametrize(
    ("kind", "data", "names"),
    [
        (
            "obj",
            b"vn 0 0 1\nfoo\n" + POLYGONS["obj"],
            {"vertex normals that no face names", "other statements"},
        ),
        ("obj", b"vt 0 0\n" + POLYGONS["obj"], {"texture coordinates that no face names"}),
        (
            "obj",
            b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 1 0\nf 1 2 3\nl 1 2\n",
            {"lines"},
        ),
        ("stl", formats.write(part(), "stl")[:-2] + b"\x1f\x80", {"colours of faces"}),
        ("stl", magics(0x7FFF, 0x001F), {"colours of faces"}),
        # Alike throughout, or without the bit that says colour.
        ("stl", formats.write(part(), "stl")[:-2] + b"\x20\x20", set()),
        ("stl", magics(0xFFFF, 0x801F), set()),
        ("stl", magics(0x001F, 0x001F), set()),
        ("off", POLYGONS["off"], {"colours of faces"}),
    ],
)
def test_what_is_left_out_is_named(kind, data, names):
    mesh_file = formats.read(data, kind)
    assert set(told(mesh_file)) - {CUT} == {f"{name} dropped" for name in names}
    _, report = refined(mesh_file)
    assert {f"{name} dropped" for name in names} <= {c["what"] for c in report["changes"]}


def binary_off(order, head, rows, faces):
    """The bytes of vertices, and of faces with their colours."""
    data = head + struct.pack(f"{order}3i", len(rows), len(faces), 0)
    data += b"".join(struct.pack(f"{order}{len(row)}f", *row) for row in rows)
    for corners, colour in faces:
        data += struct.pack(f"{order}i{len(corners)}i", len(corners), *corners)
        data += struct.pack(f"{order}i{len(colour)}f", len(colour), *colour)
    return data


RED, GREEN = [1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]
CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]


@pytest.mark.parametrize("order", [">", "<"])
@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3], [0, 2, 1]]])
def test_a_binary_off_says_what_a_text_says(order, faces):
    coloured = list(zip(faces, [RED, GREEN], strict=True))
    read = formats.read_polygons(binary_off(order, b"OFF BINARY\n", CORNERS, coloured), "off")
    lines = [f"{len(f)} {' '.join(map(str, f))} {' '.join(map(str, c))}" for f, c in coloured]
    points = "\n".join(" ".join(map(str, row)) for row in CORNERS)
    text = f"OFF\n4 2 0\n{points}\n" + "\n".join(lines) + "\n"
    same = formats.read_polygons(text.encode(), "off")
    for name in ("vertices", "offsets", "corners"):
        np.testing.assert_array_equal(getattr(read, name), getattr(same, name))
    np.testing.assert_array_equal(read.face_values[COLOUR], same.face_values[COLOUR])
    assert read.changes == ()


def test_a_binary_off_has_what_its_header_says():
    rows = [[*point, 0, 0, 1, *RED] for point in CORNERS]
    faces = [([0, 1, 2], []), ([0, 2, 3], [])]
    data = binary_off(">", b"CNOFF BINARY\r\n", rows, faces)
    mesh = formats.read(data + bytes(4), "off")
    assert mesh.layers[COLOUR].values.tolist() == [RED] * 4
    assert mesh.layers[NORMAL].values.tolist() == [[0, 0, 1]] * 4
    assert told(mesh) == {"words behind the last face dropped": 1}
    for end in (len(data) - 4, len(data) - 30, 40, 20, 12):
        with pytest.raises(UnreadableError, match="ends before its last face"):
            formats.read(data[:end], "off")


@pytest.mark.parametrize("given", [b"vt 1e39 0\n", b"vt -1e39 0\n", b"vt nan 0\n", b"vt a 0\n"])
def test_texture_coordinates_that_are_none_are_left_out_and_told(given):
    """Coordinates that float32 cannot hold, or that are no numbers, go; the others are kept."""
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n%bf 1/1 2/1 3/1\n"
    read = formats.read(text % given, "obj")
    fine, report = refined(read)
    assert UV not in fine.layers
    (change,) = report["changes"]
    assert "texture coordinates" in change["what"]
    kept = formats.read(text % b"vt 1e38 0\n", "obj")
    assert uv_of(kept).tolist() == [[[np.float64("1e38"), 0]] * 3]


@pytest.mark.parametrize("has_others", [False, True])
def test_texture_coordinates_at_corners_of_a_ply_come_before_those_at_vertices(has_others):
    # A diagonal at which they differ, as at a seam. Beside them those at vertices are not used.
    beside = "property float u\nproperty float v\n" if has_others else ""
    text = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        f"property float z\n{beside}element face 2\nproperty list uchar int vertex_indices\n"
        "property list uchar float texcoord\nend_header\n"
        + "".join(f"{xyz}{' .5 .5' if has_others else ''}\n" for xyz in SQUARE)
        + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 .1 .1 .9 .9 .1 .9\n"
    )
    mesh_file = formats.read(text.encode(), "ply")
    assert uv_of(mesh_file).reshape(2, 6) == pytest.approx(
        np.array([[0, 0, 1, 0, 1, 1], [0.1, 0.1, 0.9, 0.9, 0.1, 0.9]])
    )
    assert told(mesh_file) == {}


def test_degenerate_faces_are_dropped_and_copies_kept_and_both_counted():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -0.0]])
    mesh_file = of_triangles(vertices, np.array([[0, 1, 2], [0, 1, 3], [2, 1, 0]]))
    fine, report = refined(mesh_file)
    assert report["dropped"] == {"degenerate_faces": 1, "duplicate_faces": 0, "vertices": 1}
    assert report["totals"]["copied_faces"] == 1
    assert len(fine.faces) == 8


@pytest.mark.parametrize(
    ("kind", "data", "unused"),
    [
        ("obj", b"v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 2 \\\n 3 4\n", 1),
        ("obj", b"v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 8 8 8\nv 7 7 7\n", 3),
        ("off", b"OFF\n5 1 0\n0 0 0\n9 9 9\n1 0 0\n0 1 0\n8 8 8\n3 0 2 3\n", 2),
        ("off", b"OFF\n5 2 0\n0 0 0\n9 9 9\n1 0 0\n0 1 0\n8 8 8\n3 0 2 3\n3 0 1 1\n", 2),
        ("off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 0),
    ],
)
def test_vertices_that_no_face_uses_are_counted(kind, data, unused):
    _, report = refined(formats.read(data, kind))
    counts = [c["count"] for c in report["changes"] if "no face uses" in c["what"]]
    assert sum(counts) + report["dropped"]["vertices"] == unused


@pytest.mark.parametrize("normal", ["0 0 1", "-0.6 0 0.8", "0 0 -2.5"])
@pytest.mark.parametrize("form", ["{normal} {colour}", "{colour} {normal}"])
def test_colours_and_normals_of_an_off_are_told_apart_in_either_order(form, normal):
    # Geomview puts normals first, MeshLab colours.
    behind = " " + form.format(normal=normal, colour="255 128 0 255") + "\n"
    data = b"NCOFF\n3 1 0\n" + TRIANGLE.replace(b"\n", behind.encode()) + b"3 0 1 2\n"
    layers = formats.read(data, "off").layers
    assert layers[COLOUR].values.tolist() == [[255, 128, 0, 255]] * 3
    np.testing.assert_array_equal(layers[NORMAL].values, [[*map(float, normal.split())]] * 3)


def test_white_of_fractions_is_no_one_of_255_in_an_off():
    white = b"".join(b"v %s 1 1 1\n" % line for line in TRIANGLE.splitlines())
    lines = formats.write(formats.read(white + b"f 1 2 3\n", "obj"), "off").splitlines()
    assert lines[0] == b"COFF"
    assert all(b"." in word for line in lines[2:5] for word in line.split()[3:])


def test_colours_of_two_bytes_are_fractions_in_an_off():
    rows = TRIANGLE.replace(b"\n", b" 65535 0 32768\n")
    names = ["float x", "float y", "float z", "ushort red", "ushort green", "ushort blue"]
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property {n}\n" for n in names)
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    made = formats.write(formats.read(head.encode() + rows + b"3 0 1 2\n", "ply"), "off")
    colours = [[*map(float, line.split()[3:])] for line in made.splitlines()[2:5]]
    np.testing.assert_allclose(colours, [[1, 0, 32768 / 65535]] * 3)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "data", [b"", b"garbage", b"\0" * 200, b"ply\nformat ascii 1.0\n", b"OFF\n3 1 0\n0 0 0\n"]
)
def test_what_is_no_mesh_is_unreadable(kind, data):
    with pytest.raises(UnreadableError):
        formats.read(data, kind)


@pytest.mark.parametrize(
    ("kind", "data", "split"),
    [
        ("off", b"OFF\n3 2 0\n" + TRIANGLE + b"3 0 1 2\n2 0 1\n", 0),
        ("obj", POLYGONS["obj"] + b"f 1 2 # a side\r\nf 1 \\\n 2 3\n", 3),
        ("obj", POLYGONS["obj"] + b"# C:\\a\\\r\nf 1 2 # C:\\\nf 1 2 3\n", 3),
    ],
)
def test_faces_of_two_vertices_are_counted(kind, data, split):
    mesh_file = formats.read(data, kind)
    lost = {"faces of fewer than three vertices dropped": 1}
    assert told(mesh_file) == lost | ({CUT: split} if split else {})


@pytest.mark.parametrize("limits", [Limits(max_faces=100), Limits(max_memory_bytes=1000)])
def test_limits_hold_for_mesh_files_too(limits):
    with pytest.raises(LimitError):
        refine_mesh_file(part(), loop(), Options(scheme="loop"), limits)


ASSETS = {"fuze.ply": 1000, "lego.ply": 3072, "moebius.obj": 448, "fish_control_mesh.obj": 220}
ASSETS |= {"spot_control_mesh.obj": 372, "penguin_control_mesh.obj": 398}


@pytest.mark.parametrize("name", ASSETS)
def test_assets_refine_without_cracks(name):
    path = shared_path("assets") / name
    mesh_file = formats.read(path.read_bytes(), path.suffix[1:])
    fine, report = refined(mesh_file)
    assert len(mesh_file.faces) == ASSETS[name]
    assert len(fine.faces) == 4 * (ASSETS[name] - report["dropped"]["degenerate_faces"])
    assert welded(fine).is_watertight == welded(mesh_file).is_watertight


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_too_large_to_be_read_is_refused_before_it_is_read(kind):
    # It is no mesh at all, but for the archive: whoever read it would say so.
    data = formats.write(part(), kind) if kind == "3mf" else b"0" * 1000
    most = formats.memory_to_read(data, kind) - 1
    with pytest.raises(LimitError) as refusal:
        formats.read_within(data, kind, Limits(max_memory_bytes=most))
    assert refusal.value.limit == "memory"


@pytest.mark.parametrize("shares", [(1.0, 0.0), (0.5, 0.5)])
def test_an_off_takes_no_more_than_is_predicted_whatever_its_lines_are(shares):
    """Of the shortest: all of vertices but one face, and as many faces as vertices."""
    vertices, faces = (max(int(share * 2**20) // 7, 1) for share in shares)
    data = b"OFF\n%d %d 0\n" % (vertices, faces) + b"0 0 0\n" * vertices + b"3 0 1 2\n" * faces
    _, most = most_of(lambda: triangulated(formats.read_within(data, "off", Limits())))
    assert most < formats.memory_to_read(data, "off")
