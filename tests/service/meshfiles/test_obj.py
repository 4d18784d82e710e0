"""OBJ files that are written in other ways than the usual one say what they say."""

import numpy as np
import pytest

from service.errors import UnreadableError, UnrefinableError
from service.meshfiles import formats
from service.meshfiles.convert import converted
from service.meshfiles.mesh_file import MATERIAL, NORMAL, UV
from service.meshfiles.obj import read_obj
from service.meshfiles.parts import chosen_of
from service.options import Limits, Options
from tests.support.gltf import files

POSITIONS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 1\nv 3 3 3\n"
CORNERS = [[float(word) for word in line.split()[1:]] for line in POSITIONS.splitlines()]


def triangles(text):
    """Return the triangles of a file, by the lines of POSITIONS that their corners are."""
    mesh = formats.read(text if isinstance(text, bytes) else text.encode(), "obj")
    return [
        [CORNERS.index(corner.tolist()) for corner in mesh.vertices[face]] for face in mesh.faces
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # Each object counts back from its own faces.
        (POSITIONS[:24] + "f -3 -2 -1\n" + POSITIONS[24:] + "f -3 -2 -1\n", [[0, 1, 2], [3, 4, 5]]),
        (POSITIONS + "f 1 2 3\nf -6//-1 -5//-1 -1//-1\n", [[0, 1, 2], [0, 1, 5]]),
        (POSITIONS.replace("v 1 0 0", " v 1 0 0") + "f 1 2 3\n", [[0, 1, 2]]),
        (POSITIONS + "  f 1 2 3\nf 1 2 5\n", [[0, 1, 2], [0, 1, 4]]),
        (POSITIONS.replace(" ", "\t") + "f\t1\t2\t3\n", [[0, 1, 2]]),
        ("\ufeff" + POSITIONS + "f 1 2 3\n", [[0, 1, 2]]),
        (POSITIONS + "f 1 2 3 # the first\nf 1 2 5\n", [[0, 1, 2], [0, 1, 4]]),
        (POSITIONS.replace("2 2 1", "2 2 1 # a tip") + "f 1 2 5\n", [[0, 1, 4]]),
        (POSITIONS + "f 1 2\\\n3\nf 1 2 \\\r\n 5\r\n", [[0, 1, 2], [0, 1, 4]]),
        (POSITIONS + "f 1 2 3\nf 1 2 5\\", [[0, 1, 2], [0, 1, 4]]),
        (POSITIONS + "f 1 2 \\ \n3\nf 1 2\\\t \r\n 5\r\n", [[0, 1, 2], [0, 1, 4]]),
        # A comment that names a folder ends with its line, as in `pns large` and on the page.
        (
            "# of C:\\parts\\\n" + POSITIONS + "f 1 \\\n2 3 # D:\\\nf 1 2 5\n",
            [[0, 1, 2], [0, 1, 4]],
        ),
        # As many numbers as a hexagon has; it is concave, seen along its normal.
        (
            POSITIONS + "vt 0 0\nf 1/1 2/1 3/1\nf 1 2 3 4 5 6\n",
            [[0, 1, 2], [4, 5, 0], [4, 0, 1], [4, 1, 2], [2, 4, 3]],
        ),
        (POSITIONS + "f 1 2 3\nf 1 2\nf 3 4\n", [[0, 1, 2]]),
        # Lines that carriage returns end.
        ((POSITIONS + "f 1 2 3\nf 1 2 5\n").replace("\n", "\r"), [[0, 1, 2], [0, 1, 4]]),
        (("# a\n" + POSITIONS + "f -6 -5 -4 # b\n").replace("\n", "\r"), [[0, 1, 2]]),
    ],
)
def test_an_obj_says_the_same_however_it_is_written(text, expected):
    assert triangles(text) == expected


@pytest.mark.parametrize("corner", ["{0}", "{0}/1", "{0}/1/1"])
def test_faces_stay_in_their_order_whatever_divides_them(corner):
    """Numbers of a refined mesh follow it, and what is known of faces from elsewhere."""
    marks = ["o one", "usemtl a", "usemtl b", "usemtl a\no two", "g c"]
    faces = [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5], [0, 2, 4]]
    text = POSITIONS + "vt 0 0\nvn 0 0 1\n"
    for mark, face in zip(marks, faces, strict=True):
        text += f"{mark}\nf {' '.join(corner.format(v + 1) for v in face)}\n"
    assert triangles(text) == faces


def test_a_name_may_have_a_sign_that_begins_a_comment_elsewhere():
    names = ["Wood#1", "Material #2", "red # a comment", "#4", "two words"]
    text = POSITIONS + "".join(f"usemtl {name}\nf 1 2 3\n" for name in names)
    labels = formats.read(text.encode(), "obj").labels[MATERIAL]
    assert labels.names == ("Wood#1", "Material #2", "red", "#4", "two words")
    assert labels.of_face.tolist() == [0, 1, 2, 3, 4]


def test_a_face_of_several_groups_is_chosen_by_each():
    text = POSITIONS + "g left arm\nf 1 2 3\ng right arm\nf 1 3 4\ng legs\nf 1 4 5\n"
    mesh = formats.read(text.encode(), "obj")
    chosen = {"arm": [1, 1, 0], "left arm": [1, 0, 0], "legs": [0, 0, 1]}
    for name, faces in chosen.items():
        assert (chosen_of(mesh, Options(group=name)) == faces).all()
    with pytest.raises(UnrefinableError, match="legs, right arm"):
        chosen_of(mesh, Options(group="leg"))


def told(mesh):
    return {change.what: change.count for change in mesh.changes}


def test_corners_that_name_what_is_not_there_are_reported():
    text = POSITIONS + "vt 0 0\nf 1/1 2/1 3/2\nf 1//4 2//-9 3\n"
    assert told(formats.read(text.encode(), "obj")) == {
        "vertices dropped that no face uses": 3,
        "references to missing texture coordinates dropped": 1,
        "references to missing vertex normals dropped": 2,
        "texture coordinates of faces of which not all corners have some dropped": 1,
    }


@pytest.mark.parametrize("words", ["vt .5 .25\nf 1/1 2/1 3/1\n", "vn 0 0 1\nf 1//1 2//1 3//1\n"])
def test_corners_without_values_take_nobody_elses_away(words):
    data = (POSITIONS.replace("2 2 1", "2 0 .5")[:-8] + words + "f 1 3 4\nf 2 5 3\n").encode()
    name, options = UV if "vt" in words else NORMAL, Options(levels=1, scheme="loop")
    written = converted(data, "obj", "obj", options, None, Limits())
    mesh = read_obj(written.content)
    has = np.logical_and.reduceat(mesh.layers[name].rows >= 0, mesh.offsets[:-1])
    assert has.tolist() == [True] * 4 + [False] * 8
    assert written.report["changes"] == []
    glb = converted(data, "obj", "glb", options, None, Limits())
    tree, _ = files.unpack(glb.content)
    counts = {
        name in primitive["attributes"]: tree["accessors"][primitive["indices"]]["count"]
        for primitive in tree["meshes"][0]["primitives"]
    }
    assert counts == {True: 12, False: 24}
    assert glb.report["changes"] == []


def test_corners_with_as_many_slashes_in_all_are_read_word_by_word():
    """Six slashes and three words, of which one has none; and the parts that are left out."""
    vt = "vt 0 0\nvt 1 1\nvn 0 0 1\n"
    read = read_obj((POSITIONS + vt + "f 1//1 2 3/2/1\nf 4/1/ 5/2 6//1\n").encode())
    assert read.corners.tolist() == [0, 1, 2, 3, 4, 5]
    some = "of faces of which not all corners have some dropped"
    assert set(told(read)) == {f"texture coordinates {some}", f"vertex normals {some}"}
    with pytest.raises(UnreadableError, match=r"'1/1/1/1' is no corner"):
        read_obj((POSITIONS + vt + "f 1/1/1/1 2/2 3/2/1\n").encode())
