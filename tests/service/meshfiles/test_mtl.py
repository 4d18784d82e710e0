"""Materials of an OBJ become those of a GLB, with their textures in it."""

import pytest

from service.bodies.sibling_files import ALONE, File, Opened, SiblingFiles
from service.meshfiles.companions import companions
from service.meshfiles.convert import converted
from service.options import Limits, Options
from tests.support.gltf import files

PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)
OBJ = b"""mtllib my scene.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl glass
f 1/1 2/2 3/3
usemtl brick wall
f 1/1 3/3 4/4
"""
MTL = b"""# made by hand
newmtl glass
Kd 0.25 0.5 1
d 0.5
Ns 98
newmtl brick wall
Kd 1 1 1
map_Kd -s 1 1 1 -blendu on tex\\wall 1.png
Ke 0 0.5 0
"""


def beside(**named):
    there = {"my scene.mtl": MTL, "tex/wall 1.png": PNG} | named
    return SiblingFiles(
        lambda name: File(name, there[name]) if name in there else None, frozenset(there)
    )


def tree_of(siblings, target="glb", obj=OBJ):
    options = Options(scheme="loop")
    made = converted(obj, "obj", target, options, None, Limits(), siblings=siblings)
    told = {change["what"]: change["count"] for change in made.report["changes"]}
    return (files.unpack(made.content)[0] if target == "glb" else made.content), told


def test_each_material_is_a_primitive_with_what_its_library_says():
    tree, told = tree_of(beside())
    glass, wall = tree["materials"]
    assert (glass["name"], wall["name"]) == ("glass", "brick wall")
    assert glass["pbrMetallicRoughness"]["baseColorFactor"] == [0.25, 0.5, 1, 0.5]
    assert glass["alphaMode"] == "BLEND"
    # Blinn's exponent n and roughness r: n = 2 / r⁴ − 2.
    roughness = glass["pbrMetallicRoughness"]["roughnessFactor"]
    assert 2 / roughness**4 - 2 == pytest.approx(98)
    assert wall["emissiveFactor"] == [0, 0.5, 0]
    assert [p["material"] for p in tree["meshes"][0]["primitives"]] == [0, 1]
    (image,) = tree["images"]
    assert image["mimeType"] == "image/png"
    assert "uri" not in image
    assert told == {"embedded": 1}


def test_names_may_be_quoted_and_comments_may_stand_behind_them():
    mtl = MTL.replace(b"tex\\wall 1.png", b'"tex\\wall 1.png" # of bricks')
    mtl = mtl.replace(b"newmtl glass", b"newmtl glass # thin")
    siblings = beside(**{"my scene.mtl": mtl})
    for obj in (OBJ, OBJ.replace(b"my scene.mtl", b'"my scene.mtl"')):
        made = converted(
            obj, "obj", "glb", Options(scheme="loop"), None, Limits(), siblings=siblings
        )
        tree = files.unpack(made.content)[0]
        assert [material["name"] for material in tree["materials"]] == ["glass", "brick wall"]
        assert tree["materials"][0]["alphaMode"] == "BLEND"
        assert len(tree["images"]) == 1


def test_a_library_that_did_not_come_is_reported_and_names_stay():
    tree, told = tree_of(ALONE)
    assert [material["name"] for material in tree["materials"]] == ["glass", "brick wall"]
    assert told == {"materials not found: no my scene.mtl came with the file": 1}


def test_an_obj_keeps_its_names_and_its_library():
    text, told = tree_of(beside(), "obj")
    assert text.startswith(b"mtllib my scene.mtl\n")
    assert text.count(b"usemtl glass\n") == text.count(b"usemtl brick wall\n") == 1
    assert told == {}


def test_the_files_that_an_obj_leads_to_are_named():
    siblings = beside(**{"my scene.mtl": MTL + b"map_Bump tex/wall 1.png\nrefl no.png\n"})
    named = companions(OBJ, "obj", Opened(siblings))
    assert [file.name for file in named] == ["my scene.mtl", "tex/wall 1.png"]
    assert companions(OBJ, "obj", Opened(ALONE)) == []


@pytest.mark.parametrize(
    ("library", "image", "lies"),
    [
        # Beside its library; from the OBJ on; of another machine; in a folder that did not come.
        ("sub/my.mtl", "tex/a b.png", "sub/tex/a b.png"),
        ("sub/my.mtl", "tex/a b.png", "tex/a b.png"),
        ("sub\\my.mtl", "..\\a b.png", "a b.png"),
        ("my.mtl", "C:\\work\\tex\\a b.png", "a b.png"),
        ("my.mtl", "/home/me/a b.png", "a b.png"),
        ("D:\\my.mtl", "tex\\a b.png", "a b.png"),
        ("my.mtl", "a%20b.png", "a b.png"),
    ],
)
def test_textures_are_found_wherever_they_came_to_lie(library, image, lies):
    place = library.replace("\\", "/").removeprefix("D:/")
    there = {place: MTL.replace(b"tex\\wall 1.png", image.encode()), lies: PNG}
    siblings = SiblingFiles(lambda name: File(name, there[name]) if name in there else None)
    obj = OBJ.replace(b"my scene.mtl", library.encode())
    tree, told = tree_of(siblings, obj=obj)
    assert [entry.get("uri") for entry in tree["images"]] == [None]
    assert told == {"embedded": 1}
    # The same files lead from an OBJ to them.
    text, _ = tree_of(siblings, "obj", obj)
    assert text.startswith(f"mtllib {place}\n".encode())
    assert {file.name for file in companions(obj, "obj", Opened(siblings))} == {place, lies}


def test_a_texture_of_another_machine_that_did_not_come_is_told():
    mtl = MTL.replace(b"tex\\wall 1.png", b"C:\\work\\wall 1.png")
    siblings = beside(**{"my scene.mtl": mtl + b"map_d leaf.png\n"})
    tree, told = tree_of(siblings)
    assert tree["images"] == [{"uri": "wall%201.png"}]
    del told["not used by the document: tex/wall 1.png"]
    assert told == {
        "kept by its URI: wall%201.png did not come with the document": 1,
        "map_d of materials dropped: not written to GLB files": 1,
    }


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "gbk"])
def test_names_are_written_in_the_bytes_that_were_read(encoding):
    name = "墙".encode(encoding) if encoding == "gbk" else "façade".encode(encoding)
    obj = OBJ.replace(b"brick wall", name).replace(
        b"usemtl glass", b"g " + name + b"\nusemtl glass"
    )
    siblings = beside(**{"my scene.mtl": MTL.replace(b"brick wall", name)})
    text, _ = tree_of(siblings, "obj", obj)
    assert b"usemtl " + name + b"\n" in text
    assert b"g " + name + b"\n" in text
    tree, _ = tree_of(siblings, obj=obj)
    assert "baseColorTexture" in tree["materials"][1]["pbrMetallicRoughness"]


def test_smoothing_groups_are_hard_edges_and_stay_in_an_obj():
    roof = b"v 0 0 0\nv 0 4 0\nv 2 0 1\nv 2 4 1\nv -2 0 1\nv -2 4 1\n"
    roof += b"s 1\nf 1 3 4\nf 1 4 2\ns 2\nf 1 2 6\nf 1 6 5\n"
    options = Options(scheme="loop", crease="normals")
    made = converted(roof, "obj", "obj", options, None, Limits())
    assert made.report["levels"][0]["edges"]["crease"] == 1
    assert (made.content.count(b"s 1\n"), made.content.count(b"s 2\n")) == (1, 1)
    assert b"vn" not in made.content
    one = converted(roof.replace(b"s 2", b"s 1"), "obj", "obj", options, None, Limits())
    assert "crease" not in one.report["levels"][0]["edges"]
