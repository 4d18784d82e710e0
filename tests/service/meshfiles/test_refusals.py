"""Refusals of mesh files name the place, in the words of the file."""

import pytest

from pns_common.operator.scheme import loop
from service.errors import ServiceError, UnrefinableError
from service.meshfiles import formats
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.options import Limits, Options
from tests.service.meshfiles.test_ply import ply

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 1\nv 3 3 3\n"
POINTS = "0 0 0\n1 0 0\n0 1 0\n"
PLY = ply("")
PYTHONS = {"islice", "inhomogeneous", "int", "charset", "array", "Traceback"}

# What a file holds, and what is said of it.
WRONG = [
    ("obj", OBJ + "f 0 1 2\n", "line 7 of the OBJ file: a face names vertex 0"),
    ("obj", OBJ + "\nf 1 2 7\n", "line 8 .* vertex 7, and there are 6"),
    ("obj", "v 0 0 0\nf 1 -2 1\n" + OBJ, "line 2 .* vertex -2, and there are 1"),
    ("obj", OBJ + "f 1 2 \\\n x\n", "line 7 .* 'x' is no number"),
    ("obj", OBJ + "f 1 2 \\\n x\\", "line 7 .* 'x' is no number"),
    ("obj", OBJ.replace("2 2 1", "2 2") + "f 1 2 3\n", "line 5 .* a vertex has 2 coordinates"),
    ("obj", OBJ.replace("2 2 1", "2,5 2,5 1") + "f 1 2 5\n", "line 5 .* '2,5' is no number"),
    ("obj", OBJ + "f 1 1_0 2\n", "line 7 .* '1_0' is no number"),
    ("obj", OBJ + "vt 0 0\nf 1/1 2/1_0 3/1\n", "line 8 .* '2/1_0' is no corner of a face"),
    ("obj", OBJ.replace("2 2 1", "2_2 2 1") + "f 1 2 5\n", "line 5 .* is no number"),
    ("obj", OBJ + "f 1.0 2 3\n", "line 7 .* '1.0' is no number"),
    ("obj", (OBJ + "f 1 2 7\n").replace("\n", "\r"), "line 7 .* vertex 7, and there are 6"),
    ("obj", OBJ + "f 1 2 99999999999999999999999\n", "OBJ"),
    ("obj", OBJ + "f 1 2\nf 2 3\n", "the OBJ file has no faces"),
    ("off", "OFF\n3 1 0\n" + POINTS + "3 0 1 99999999999999999999999\n", "OFF"),
    ("off", "OFF\n3 " + "9" * 25 + " 0\n" + POINTS + "3 0 1 2\n", "OFF"),
    ("off", "OFF\n999999999999999999 1 0\n" + POINTS + "3 0 1 2\n", "OFF"),
    ("off", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "OFF"),
    ("off", "OFF\n3 1 0\n" + POINTS + "-3 0 1 2\n", "OFF"),
    ("off", "OFF\n3 1 0\n" + POINTS + "4 0 1 2\n", "OFF"),
    ("off", "OFF\n3 1 0\n" + POINTS + "3 0 1 9\n", "face 0 .* vertex 9, expected 0 … 2"),
    ("off", "OFF\n3 1 0\n" + POINTS + "3 0 1 -1\n", "face 0 .* vertex -1, expected 0 … 2"),
    ("off", "OFF\n3 1 0\n0 0 0\n1 0 0\nnan 1 0\n3 0 1 2\n", "vertex 2 .* NaN or infinite"),
    ("off", "OFF\n0 2 0\n0 0 0\n1 0 0\n", "no faces of three vertices"),
    ("ply", ply("<").replace(b"face 3", b"face 9" + b"9" * 17), "ends after"),
    ("ply", ply("<").replace(b"uint vertex", b"quad vertex"), "line 9 of the PLY header"),
    ("ply", ply("<")[:100], "its header has no end"),
    ("ply", PLY.replace(b"4 0 1 2 3", b"4 0 1,5 2 3"), r"line 16 of the PLY file: '1,5'"),
    ("ply", PLY.replace(b"4 0 1 2 3", b"4 0 1.5 2 3"), "vertex_indices .* 1.5, no whole number"),
    ("ply", PLY.replace(b"4 0 1 2 3", b"4.5 0 1 2 3"), "ends after"),
    # No comment, which would hide the numbers behind it.
    ("ply", PLY.replace(b"4 0 1 2 3", b"4 0 1 #2 3"), r"line 16 of the PLY file: '#2'"),
    ("ply", PLY.replace(b"4 0 1 2 3", b"-4 0 1 2 3"), "ends after"),
    ("ply", b"OFF\n", "this is not a PLY"),
    ("stl", bytes(80) + b"\xff\xff\xff\xff", "STL"),
    ("stl", "solid\nfacet\nvertex 0 0 0\nvertex 1 0 x\nvertex 0 1 0\nendsolid\n", "STL"),
    ("stl", b"<html>", "not an STL file: it begins with '<html>'"),
    ("stl", bytes(80) + b"\x09\0\0\0" + bytes(60), "cut off, or is none: it says 9 facets"),
    ("stl", "solid\nfacet\nvertex 0 0 0\n", "cut off: it ends within a facet"),
    (
        "stl",
        "solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nfacet normal 0 0\n",
        "STL",
    ),
]


@pytest.mark.parametrize(("kind", "content", "says"), WRONG)
def test_what_is_wrong_is_said_with_its_place(kind, content, says):
    data = content.encode() if isinstance(content, str) else content
    with pytest.raises(ServiceError, match=says) as refusal:
        formats.read(data, kind)
    assert refusal.value.status in (400, 422)
    assert not PYTHONS & set(refusal.value.detail.split())


def test_a_face_of_coincident_vertices_alone_makes_no_mesh():
    mesh = formats.read(b"OFF\n3 1 0\n0 0 0\n0 0 0\n0 1 0\n3 0 1 2\n", "off")
    with pytest.raises(UnrefinableError):
        refine_mesh_file(mesh, loop(), Options(scheme="loop"), Limits())
