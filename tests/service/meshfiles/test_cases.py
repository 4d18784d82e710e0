"""Files as they occur: the shared collection, and each of its kinds made here."""

import struct

import numpy as np
import pytest

from service.bodies.sibling_files import ALONE, folder_of
from service.errors import UnrefinableError
from service.gltf.read.container import read_glb
from service.meshfiles import formats
from service.meshfiles.convert import converted
from service.meshfiles.mesh_file import COLOUR, MATERIAL
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.flattened import flatten
from tests.support.gltf.shapes import box
from tests.support.shared import shared_path

CORNERS = [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
QUADS = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
TRIANGLES = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]
OBJ = "".join("v {} {} {}\n".format(*corner) for corner in CORNERS)
OBJ_FACES = "".join("f {} {} {} {}\n".format(*(c + 1 for c in quad)) for quad in QUADS)
OFF_BODY = "".join("{} {} {}\n".format(*corner) for corner in CORNERS)
OFF_BODY += "".join("4 {} {} {} {}\n".format(*quad) for quad in QUADS)
PLY_HEAD = (
    "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
    "property float z\n{}element face 12\nproperty list uchar int vertex_indices\n{}end_header\n"
)
PLY_FACES = "".join("3 {} {} {}\n".format(*triangle) for triangle in TRIANGLES)
PLY_POINTS = "".join("{} {} {}\n".format(*corner) for corner in CORNERS)


def stl_text():
    facets = (
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*CORNERS[corner]) for corner in triangle)
        + "endloop\nendfacet\n"
        for triangle in TRIANGLES
    )
    return "solid part\n" + "".join(facets)


def stl_binary(head=b"", count=12, order="<"):
    corners = np.array(CORNERS, dtype=f"{order}f4")[np.array(TRIANGLES)]
    facets = b"".join(bytes(12) + three.tobytes() + bytes(2) for three in corners)
    return head.ljust(80, b"\0") + struct.pack(f"{order}I", count) + facets


def strips():
    head = PLY_HEAD.format("", "").replace("ascii", "binary_little_endian")
    head = head.replace("element face 12", "element tristrips 1").replace("uchar", "int")
    # Of two triangles each: the diagonal is the other one.
    runs = [number for a, b, c, d in QUADS for number in (a, b, d, c, -1)]
    points = np.array(CORNERS, dtype="<f4").tobytes()
    return head.encode() + points + struct.pack(f"<{1 + len(runs)}i", len(runs), *runs)


def ply(beside="", behind="", points=PLY_POINTS, tail=""):
    return PLY_HEAD.format(beside, behind) + points + PLY_FACES + tail


RGB = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
EDGES = "element edge 1\nproperty int vertex1\nproperty int vertex2\n"
OTHERS = "property float quality\nproperty float other\n"
CUBES = {
    "obj": {
        "the old name of f": OBJ + OBJ_FACES.replace("f ", "fo "),
        "normals that are no numbers": OBJ + "vn 0 0 1,\n" + OBJ_FACES,
        "a statement nobody knows": OBJ + "shadow_obj a\n\n" + OBJ_FACES,
        "in UTF-16": (OBJ + OBJ_FACES).encode("utf-16"),
        "lines ended by returns": (OBJ + OBJ_FACES).replace("\n", "\r"),
        "no numbers, in Microsoft's words": OBJ + "vn -1.#IND 1.#QNAN -nan(ind)\n" + OBJ_FACES,
        "behind a mark": "\ufeff" + OBJ + OBJ_FACES,
    },
    "off": {
        "counts glued to the header": "OFF8 6 0\n" + OFF_BODY,
        "blanks before the header": "\t  OFF8 6 12 # comment\n" + OFF_BODY,
        "small letters": "off\n8 6 0\n" + OFF_BODY,
        "normals, colours": "NCOFF\n8 6 0\n" + OFF_BODY.replace("\n", " 0 0 1 255 0 0 255\n", 8),
        "words behind": "OFF\n8 6 0\n" + OFF_BODY + "made by X\n",
        "counts on lines": "OFF\n8\n6\n0\n" + OFF_BODY,
        "no count of edges": "OFF\n8 6\n" + OFF_BODY,
        "no header": "# a\n8 6 12\n" + OFF_BODY,
        "one number a line": ("OFF 8 6 0 " + OFF_BODY).replace(" ", "\n"),
        "comments": "# a\nOFF # b\n\n8 6 0\n# c\n" + OFF_BODY.replace("\n4", "\n\n#4\n4"),
    },
    "ply": {
        "edges": ply("", EDGES, tail="0 1\n"),
        "blank lines": ply().replace("end_header\n", "end_header\n\n\n"),
        "vertices over two lines": ply(RGB, points=PLY_POINTS.replace("\n", "\n255 0 0\n")),
        "a comment before the format": ply().replace("ply\n", "ply\ncomment a\n"),
        "a line without its keyword": ply().replace("element face", "Made by X\nelement face"),
        "no numbers": ply(OTHERS, points=PLY_POINTS.replace("\n", " -1.#IND -nan(ind)\n")),
        "a comment among the numbers": ply().replace("3 0 3 2", "comment b\n3 0 3 2"),
        "lines ended by returns": ply().replace("\n", "\r"),
        "strips": strips(),
    },
    "stl": {
        "no end": stl_text(),
        "another end": stl_text() + "end solid part\n",
        "on one line": stl_text().replace("\n", " "),
        "in capitals": stl_text().upper(),
        "its own words": stl_text().replace("part", "vertex endloop") + "endsolid vertex endloop\n",
        "of a big-endian machine": stl_binary(order=">"),
        "bytes behind": stl_binary() + b"tail",
        "a header like a text": stl_binary(b"solid part") + b"\r\n",
        "a count of 0": stl_binary(count=0),
        "a count too large": stl_binary(count=99),
    },
}


def refined(data, kind, target, siblings=ALONE, **options):
    options = Options(**{"scheme": "loop", "levels": 1} | options)
    return converted(data, kind, target, options, None, Limits(), siblings=siblings)


def area(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def is_closed(mesh):
    _, vertex = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = vertex.reshape(-1)[mesh.faces]
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = ({tuple(side) for side in way.tolist()} for way in (sides, sides[:, ::-1]))
    return len(there) == len(sides) and there == back


def assert_cube(data, kind):
    mesh = formats.read(data, kind)
    assert len(mesh.faces) == 12
    assert area(mesh) == pytest.approx(24, rel=1e-9)
    assert is_closed(mesh)


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in CUBES for name in CUBES[kind]])
def test_a_cube_is_read_however_it_is_written(kind, name):
    data = CUBES[kind][name]
    data = data.encode() if isinstance(data, str) else data
    assert_cube(data, kind)
    for target in ("glb", kind):
        assert refined(data, kind, target).report["totals"]["faces"] == 48


COLLECTION = """
ply_ascii_edge_element.ply ply_ascii_blank_lines.ply ply_ascii_vertex_over_two_lines.ply
ply_comment_before_format.ply ply_tristrips_binary.ply ply_vertex_colours_binary.ply
obj_vertex_colours.obj obj_two_materials.obj obj_vn_trailing_comma.obj obj_fo_statement.obj
off_counts_glued_to_header.off off_leading_blanks.off off_counts_on_lines.off
stl_ascii_no_endsolid.stl stl_binary_trailing_bytes.stl stl_binary_solid_header_crlf_tail.stl
"""


@pytest.mark.parametrize("name", COLLECTION.split())
def test_the_collections_cubes_are_whole(name):
    path = shared_path("cases") / name
    data, kind = path.read_bytes(), path.suffix[1:]
    assert_cube(data, kind)
    made = refined(data, kind, "glb")
    assert made.report["totals"]["faces"] == 48
    (shown,) = files.unpack(made.content)[0]["meshes"]
    assert len(shown["primitives"]) == (2 if "materials" in name else 1)
    coloured = "COLOR_0" in shown["primitives"][0]["attributes"]
    assert coloured == ("colours" in name or "two_lines" in name)
    if "materials" in name:
        again = formats.read(refined(data, kind, "obj").content, "obj")
        assert len(again.labels[MATERIAL].names) == 2


def test_the_collections_hard_edges_are_as_hard_in_an_obj_as_in_a_glb():
    folder = shared_path("cases")
    ours = (folder / "obj_hard_edges_by_vn.obj").read_bytes()
    theirs = (folder / "obj_hard_edges_reference.glb").read_bytes()
    edges = [
        refined(data, kind, "glb", crease="normals").report["levels"][0]["edges"]["crease"]
        for data, kind in ((ours, "obj"), (theirs, "glb"))
    ]
    assert edges[0] == edges[1] > 0
    smooth = refined(ours, "obj", "glb", normals="smooth")
    (primitive,) = files.unpack(smooth.content)[0]["meshes"][0]["primitives"]
    assert "NORMAL" in primitive["attributes"]


def test_the_collections_glbs_are_read_whole():
    folder = shared_path("cases")
    tail = refined((folder / "glb_one_trailing_byte.glb").read_bytes(), "glb", "glb").report
    assert {
        "pointer": "",
        "code": "bytes-behind",
        "what": "bytes behind the GLB left out",
        "count": 1,
    } in tail["changes"]
    copies = refined((folder / "glb_gpu_instancing_to_stl.glb").read_bytes(), "glb", "stl")
    assert copies.faces == 3 * copies.report["totals"]["faces"]
    seam = refined((folder / "glb_seam_off_by_1e-6.glb").read_bytes(), "glb", "glb", levels=2)
    assert seam.report["hints"]["near-misses"]["options"] == ["weld_tolerance=0.001"]
    joined = refined(
        (folder / "glb_seam_off_by_1e-6.glb").read_bytes(), "glb", "glb", weld_tolerance=1e-5
    )
    assert not any("border vertices" in change["what"] for change in joined.report["changes"])


COLOURED = {
    "obj": "v 0 0 0 1 0 .25\nv 1 0 0 0 1 .25\nv 0 1 0 0 0 .25\nf 1 2 3\n",
    "ply": PLY_HEAD.format(
        "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float quality\n",
        "",
    )
    .replace("vertex 8", "vertex 3")
    .replace("face 12", "face 1")
    + "0 0 0 255 0 64 1\n1 0 0 0 255 64 2\n0 1 0 0 0 64 4\n3 0 1 2\n",
    "off": "COFF\n3 1 0\n0 0 0 255 0 64 255\n1 0 0 0 255 64 255\n0 1 0 0 0 64 255\n3 0 1 2\n",
}


@pytest.mark.parametrize("target", ["obj", "ply", "off", "glb"])
@pytest.mark.parametrize("kind", COLOURED)
def test_vertex_colours_are_kept_and_blended_linearly(kind, target):
    made = refined(COLOURED[kind].encode(), kind, target).content
    if target == "glb":
        tree, binary = files.unpack(made)
        attributes = tree["meshes"][0]["primitives"][0]["attributes"]
        colours = files.values_of(tree, binary, attributes["COLOR_0"])
        accessor = tree["accessors"][attributes["COLOR_0"]]
        assert accessor.get("normalized", False) == (kind != "obj")
        assert ("_QUALITY" in attributes) == (kind == "ply")
    else:
        mesh = formats.read(made, target)
        colours = mesh.layers[COLOUR].values
        whole = kind if target == "ply" else target
        assert (colours.dtype == np.uint8) == (whole in ("ply", "off") and kind != "obj")
        assert ("_quality" in mesh.layers) == (kind == target == "ply")
    if colours.dtype.kind in "ui":
        colours = colours / 255
    found = sorted(map(tuple, np.round(colours[:, :2], 2).tolist()))
    ends, middles = [(0, 0), (0, 1), (1, 0)], [(0, 0.5), (0.5, 0), (0.5, 0.5)]
    np.testing.assert_allclose(found, sorted(ends + middles), atol=0.01)


def test_coloured_vertices_of_an_obj_stay_one_at_seams_of_texture_coordinates():
    points = "v 0 0 0 1 0 0\nv 1 0 0 0 .3 0\nv 1 1 0 0 0 .7\nv 0 1 1 1 1 1\n"
    seam = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 5 5\nf 1/1 2/2 3/3\nf 1/5 3/3 4/4\n"
    for goal in ({"levels": 2}, {"tolerance": "1%"}):
        made = formats.read(refined((points + seam).encode(), "obj", "obj", **goal).content, "obj")
        assert len(made.vertices) == len(np.unique(made.vertices, axis=0))


def test_colours_up_to_255_are_fractions_of_it():
    float_ply = (
        COLOURED["ply"].replace("uchar red", "float red").replace("uchar green", "float green")
    )
    paint = "#MRGB ffff0040ff00ff40ff000040\n"
    plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    given = {
        "obj": [
            COLOURED["obj"].replace(" 1 0 .25", " 255 0 64").replace(" 0 1 .25", " 0 255 64"),
            plain + paint + "f 1 2 3\n",
        ],
        "ply": [float_ply.replace("uchar blue", "float blue")],
        "off": [COLOURED["off"]],
    }
    given["obj"][0] = given["obj"][0].replace(" 0 0 .25", " 0 0 64")
    for kind, texts in given.items():
        for text in texts:
            colours = formats.read(text.encode(), kind).layers[COLOUR].values
            assert colours.dtype == np.uint8
            assert colours[:, :3].tolist() == [[255, 0, 64], [0, 255, 64], [0, 0, 64]]
    part = formats.read((plain + paint[:-9] + "\nf 1 2 3\n").encode(), "obj")
    assert [change.what for change in part.changes] == [
        "colours that not all vertices have dropped"
    ]


def test_colours_of_faces_stay_with_the_faces_made_of_them():
    text = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n"
    for target in ("off", "ply"):
        mesh = formats.read(refined(text.encode(), "off", target).content, target)
        colours = mesh.face_values[COLOUR][:, :3]
        assert colours.tolist() == 4 * [[255, 0, 0]] + 4 * [[0, 0, 255]]


def test_colours_of_faces_below_those_of_vertices_are_reported():
    points, faces = PLY_POINTS.replace("\n", " 255 0 0 .5\n"), PLY_FACES.replace("\n", " 0 0 255\n")
    head = PLY_HEAD.format(f"{RGB}property float alpha\n", RGB)
    made = refined((head + points + faces).encode(), "ply", "glb")
    tree, binary = files.unpack(made.content)
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    assert (files.values_of(tree, binary, attributes["COLOR_0"])[:, :3] == [255, 0, 0]).all()
    assert "_ALPHA" in attributes
    assert any("colours of faces" in change["what"] for change in made.report["changes"])


def test_a_seam_that_is_nearly_closed_is_reported_with_what_closes_it():
    shape = box()
    flat = shape["indices"].reshape(-1)
    noise = 1e-7 * np.random.default_rng(0).standard_normal((len(flat), 3))
    points = shape["POSITION"][flat] + noise
    glb = files.glb(
        [{"POSITION": points.astype(np.float32), "indices": np.arange(len(flat)).reshape(-1, 3)}]
    )
    report = refined(glb, "glb", "glb").report
    (near,) = [change for change in report["changes"] if change["code"] == "near-misses"]
    assert near["count"] == len(flat)
    assert report["hints"]["near-misses"]["options"] == ["weld_tolerance=0.001"]
    assert read_glb(glb).tail == 0


@pytest.mark.parametrize("target", ["obj", "ply", "off", "stl", "glb"])
@pytest.mark.parametrize("levels", [1, 2])
def test_one_material_is_refined_and_its_neighbours_meet_it(target, levels):
    data = (shared_path("cases") / "obj_two_materials.obj").read_bytes()
    whole = formats.read(data, "obj")
    for name in whole.labels[MATERIAL].names:
        made = refined(data, "obj", target, levels=levels, material=name).content
        mesh = flatten(made, "obj", Limits())[0] if target == "glb" else formats.read(made, target)
        assert is_closed(mesh)
        if target in ("obj", "glb"):
            label = mesh.labels[MATERIAL]
            own = int(whole.labels[MATERIAL].named(name).sum())
            assert label.named(name).sum() == own * 4**levels
            assert (~label.named(name)).sum() < (12 - own) * 4**levels
    with pytest.raises(UnrefinableError, match="m0, m1"):
        refined(data, "obj", target, material="m2")


UV, EMBEDDED = {"TEXCOORD_0"}, {"embedded"}


@pytest.mark.parametrize(
    ("name", "told", "layers"),
    [
        *(("A1_partial_uv.obj", set(), UV), ("A3_partial_normals.obj", set(), {"NORMAL"})),
        *((name, set(), set()) for name in ("F1_backslash_space.obj", "G1_constant_attribute.stl")),
        *(("H1_texturefile.ply", set(), UV), ("I1_crease_tag.obj", set(), set())),
        *((name, EMBEDDED, UV) for name in ("D1_sub/D1.obj", "D2/D2_windows_path.obj")),
    ],
)
def test_files_of_the_fourth_collection_come_whole(name, told, layers):
    path = shared_path("cases") / "4" / name
    kind, cut = path.suffix[1:], {"triangles added by cutting polygons"}
    made = refined(path.read_bytes(), kind, kind, siblings=folder_of(path))
    assert set(formats.read(made.content, kind).layers) == layers
    assert {change["what"] for change in made.report["changes"]} <= cut
    if told:
        glb = refined(path.read_bytes(), kind, "glb", siblings=folder_of(path))
        assert {change["what"] for change in glb.report["changes"]} == told | cut
