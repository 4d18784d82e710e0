"""PLY: lists of every length, in every order of bytes and as text, say the same."""

import struct

import numpy as np
import pytest

from service.bodies.sibling_files import File, SiblingFiles
from service.errors import UnreadableError
from service.meshfiles.convert import converted
from service.meshfiles.formats import read, write
from service.meshfiles.mesh_file import COLOUR, NORMAL, UV, MeshFile
from service.meshfiles.ply import ply_header, read_ply
from service.meshfiles.text import encoding_of
from service.options import Limits, Options
from tests.support.gltf.files import unpack

POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 2.0, 0.0)]
POLYGONS = [(0, 1, 2, 3), (0, 2, 4), (0, 1, 2, 4, 3)]
FANS = [[0, 1, 2], [0, 2, 3], [0, 2, 4], [0, 1, 2], [0, 2, 4], [0, 4, 3]]


def ply(order, polygons=POLYGONS, beside=False):
    """Polygons as Blender writes them; `beside`: with numbers and a list around each, and edges.

    `order` is that of bytes, or "" for text.
    """
    name = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    lines = [
        "ply",
        f"format {name} 1.0",
        "comment element face 99",
        f"element vertex {len(POINTS)}",
        *(f"property float {axis}" for axis in "xyz"),
        f"element face {len(polygons)}",
        *(["property uchar flag"] if beside else []),
        "property list uchar uint vertex_indices",
        *(["property short weight", "property list ushort float texcoord"] if beside else []),
        *(["property double last"] if beside else []),
        *(["element edge 2", "property int vertex1", "property int vertex2"] if beside else []),
        "end_header",
    ]
    rows = [("3f", point) for point in POINTS]
    for number, corners in enumerate(polygons):
        size = len(corners)
        row, form = (size, *corners), f"B{size}I"
        if beside:
            uv = [corner / 8 for corner in corners for _ in "uv"]
            row, form = (7, *row, number, 2 * size, *uv, 0.5), f"B{form}hH{2 * size}fd"
        rows.append((form, row))
    rows += [("2i", (0, 1)), ("2i", (1, 2))] if beside else []
    head = ("\n".join(lines) + "\n").encode()
    if order:
        return head + b"".join(struct.pack(order + form, *row) for form, row in rows)
    return head + "".join(" ".join(map(str, row)) + "\n" for _, row in rows).encode()


def corners_of(mesh):
    return mesh.vertices[mesh.faces]


@pytest.mark.parametrize("order", ["<", ">", ""])
@pytest.mark.parametrize("beside", [False, True])
def test_polygons_of_many_sizes_are_the_same_in_every_encoding(order, beside):
    mesh = read(ply(order, beside=beside), "ply")
    np.testing.assert_array_equal(corners_of(mesh), np.array(POINTS)[FANS])
    if beside:
        uv = mesh.layers[UV]
        expected = np.repeat(np.array(FANS).reshape(-1, 1) / 8, 2, axis=1)
        np.testing.assert_array_equal(uv.values[uv.rows], expected)
        of_polygon = [0, 0, 1, 2, 2, 2]
        assert mesh.face_values["weight"][:, 0].tolist() == of_polygon
        assert mesh.face_values["flag"].dtype == np.uint8
    assert any("element edge" in change.what for change in mesh.changes) == beside


def test_polygons_of_fewer_than_three_corners_make_no_triangle():
    few = [(), (1,), (0, 1)]
    assert len(read(ply("<", [*few, (0, 1, 2, 3)]), "ply").faces) == 2
    with pytest.raises(UnreadableError):
        read(ply("<", few), "ply")


@pytest.mark.parametrize("order", ["<", ""])
def test_a_file_that_was_cut_off_says_where(order):
    for cut in (1, 4):
        with pytest.raises(UnreadableError, match="3 faces and ends after 2"):
            read(ply(order)[: -cut - (order == "")], "ply")


TEXTURED = b"""ply
format ascii 1.0
comment TextureFile %b
comment TextureFile b.png
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
property int texnumber
end_header
0 0 0
1 0 0
1 1 0
0 1 0
3 0 1 2 6 0 0 1 0 1 1 0
3 0 2 3 6 0 0 1 1 0 1 1
"""
PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)


@pytest.mark.parametrize("name", [b"my skin.png", "façade.png".encode("latin-1")])
def test_textures_stay_in_a_ply_and_come_into_a_glb(name):
    there = {name.decode(encoding_of(name)): PNG, "b.png": PNG + b"b"}
    siblings = SiblingFiles(lambda own: File(own, there[own]) if own in there else None)
    options = Options(levels=1, scheme="loop")

    def made(target, data=TEXTURED % name):
        return converted(data, "ply", target, options, None, Limits(), siblings=siblings)

    again = made("ply")
    assert b"comment TextureFile " + name + b"\ncomment TextureFile b.png\n" in again.content
    assert again.report["changes"] == []
    tree, binary = unpack(made("glb").content)
    shown = [
        entry["pbrMetallicRoughness"]["baseColorTexture"]["index"] for entry in tree["materials"]
    ]
    views = [tree["bufferViews"][tree["images"][number]["bufferView"]] for number in shown]
    places = [(view.get("byteOffset", 0), view["byteLength"]) for view in views]
    images = [bytes(binary[start : start + length]) for start, length in places]
    assert images == [*there.values()]
    # A texture for each face.
    assert [each["material"] for each in tree["meshes"][0]["primitives"]] == [0, 1]
    lost = "names of textures dropped: "
    told = [change["what"] for change in made("obj").report["changes"]]
    assert f"{lost}not written to OBJ files" in told
    bare = (TEXTURED % name).replace(b"float texcoord", b"float other")
    told = {change["what"]: change["count"] for change in made("glb", bare).report["changes"]}
    assert told[f"{lost}there are no texture coordinates"] == 2


def test_normals_colours_and_double_positions_come_back_in_their_types():
    head = ply_header(ply(""))
    assert [element.name for element in head.elements] == ["vertex", "face"]
    beside = ["nx", "ny", "nz"]
    properties = "".join(f"property float {name}\n" for name in beside)
    properties += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "alpha"))
    text = ply("", [(0, 1, 2)]).decode().replace("float x", "double x")
    text = text.replace("property float z\n", f"property float z\n{properties}")
    for point in POINTS:
        row = "{} {} {}\n".format(*point)
        text = text.replace(row, row.strip() + " 0 0 1 255 128 0 64\n", 1)
    again = read(write(read(text.encode(), "ply"), "ply"), "ply")
    assert again.double
    assert again.layers[COLOUR].values.dtype == np.uint8
    assert again.layers[COLOUR].values[0].tolist() == [255, 128, 0, 64]
    assert again.layers[NORMAL].values[0].tolist() == [0, 0, 1]


def test_faces_of_more_corners_than_a_byte_counts_are_written_whole():
    for sizes in ([300], [3, 300, 4]):
        offsets = np.append(0, np.cumsum(sizes))
        corners = np.concatenate([np.arange(size) for size in sizes])
        points = np.random.default_rng(0).random((300, 3))
        values = {"_weight": np.arange(len(sizes), dtype=np.int32)[:, None]}
        mesh = MeshFile(points, offsets, corners, face_values=values)
        again = read_ply(write(mesh, "ply"))
        assert again.corners.tolist() == corners.tolist()
        assert again.sizes.tolist() == sizes
        assert again.face_values["weight"].tolist() == [[face] for face in range(len(sizes))]
