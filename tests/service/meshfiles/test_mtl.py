"""Materials of an OBJ become those of a GLB, with their textures in it."""

from __future__ import annotations

from typing import Any

import pytest

from service.bodies.sibling_files import ALONE, File, SiblingFiles
from service.meshfiles.convert import converted
from service.meshfiles.mtl import named_files
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


def beside(**named: bytes) -> SiblingFiles:
    there = {"my scene.mtl": MTL, "tex/wall 1.png": PNG} | named
    return SiblingFiles(
        lambda name: File(name, there[name]) if name in there else None, frozenset(there)
    )


def tree_of(siblings: SiblingFiles, target: str = "glb") -> tuple[Any, dict[str, int]]:
    options = Options(scheme="loop")
    made = converted(OBJ, "obj", target, options, None, Limits(), siblings=siblings)
    told = {change["what"]: change["count"] for change in made.report["changes"]}
    return (files.unpack(made.content)[0] if target == "glb" else made.content), told


def test_each_material_is_a_primitive_with_what_its_library_says() -> None:
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


def test_names_may_be_quoted_and_comments_may_stand_behind_them() -> None:
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


def test_a_library_that_did_not_come_is_reported_and_names_stay() -> None:
    tree, told = tree_of(ALONE)
    assert [material["name"] for material in tree["materials"]] == ["glass", "brick wall"]
    assert told == {"materials not found: no my scene.mtl came with the file": 1}


def test_an_obj_keeps_its_names_and_its_library() -> None:
    text, told = tree_of(beside(), "obj")
    assert text.startswith(b"mtllib my scene.mtl\n")
    assert text.count(b"usemtl glass\n") == text.count(b"usemtl brick wall\n") == 1
    assert told == {}


def test_the_files_that_an_obj_leads_to_are_named() -> None:
    assert named_files(OBJ, beside()) == ["my scene.mtl", "tex/wall 1.png"]
    assert named_files(OBJ, ALONE) == []


def test_smoothing_groups_are_hard_edges_and_stay_in_an_obj() -> None:
    roof = b"v 0 0 0\nv 0 4 0\nv 2 0 1\nv 2 4 1\nv -2 0 1\nv -2 4 1\n"
    roof += b"s 1\nf 1 3 4\nf 1 4 2\ns 2\nf 1 2 6\nf 1 6 5\n"
    options = Options(scheme="loop", crease="normals")
    made = converted(roof, "obj", "obj", options, None, Limits())
    assert made.report["levels"][0]["edges"]["crease"] == 1
    assert (made.content.count(b"s 1\n"), made.content.count(b"s 2\n")) == (1, 1)
    assert b"vn" not in made.content
    one = converted(roof.replace(b"s 2", b"s 1"), "obj", "obj", options, None, Limits())
    assert "crease" not in one.report["levels"][0]["edges"]
