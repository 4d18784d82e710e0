"""`pns subdivide`: every format into every other, and every loss said."""

import json

import msgspec
import numpy as np
import pytest
import trimesh

from service.gltf.read.container import read_glb
from service.meshfiles import formats
from service.meshfiles.example import part, part_glb
from service.meshfiles.glb import triangles_glb
from tests.service.cli.trees import FACES, tree_of, tree_of_bytes
from tests.support.gltf import files
from tests.support.gltf.shapes import box

# One level of Loop: what is asked here is no matter of depth.
ONCE = ("--scheme", "loop", "--levels", "1")


def test_example_then_subdivide_as_the_readme_has_it(pns, tmp_path):
    assert pns("example", "part.glb").code == 0
    command = "subdivide part.glb -o part2.glb --levels 2 --report report.json"
    outcome = pns(*command.split())
    assert (outcome.code, outcome.out) == (0, "")
    assert f"{16 * FACES:,} triangles" in outcome.err
    report = json.loads((tmp_path / "report.json").read_text())
    assert report == tree_of(tmp_path / "part2.glb")["asset"]["extras"]["pns"]
    assert report["totals"]["faces"] == 16 * FACES


def test_materials_and_textures_follow_a_result_and_replace_nothing(pns, tmp_path):
    (tmp_path / "other").mkdir()
    obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
    (tmp_path / "in.obj").write_text(obj)
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    (tmp_path / "t.png").write_bytes(b"t")
    (tmp_path / "other" / "m.mtl").write_text("newmtl b\n")
    command = ["subdivide", "in.obj", "-o", "other/x.obj", "--report", "r.json", *ONCE]
    told = pns(*command).err
    assert "1 × copied beside the result: t.png" in told
    assert "--force replaces them): m.mtl" in told
    assert (tmp_path / "other" / "m.mtl").read_text() == "newmtl b\n"
    assert "1 × copied beside the result: m.mtl" in pns(*command, "--force").err
    assert (tmp_path / "other" / "m.mtl").read_text() == (tmp_path / "m.mtl").read_text()
    assert "copied" not in pns(*command).err
    # Beside its source nothing is to be copied.
    assert "copied" not in pns("subdivide", "in.obj", "-o", "x.obj", *ONCE).err


def test_what_happens_in_many_places_is_said_once(pns, tmp_path):
    tree, binary = files.document([{**box(), "mode": 5} for _ in range(3)], [box()])
    (tmp_path / "strips.glb").write_bytes(files.pack(tree, binary))
    outcome = pns("subdivide", "strips.glb", "-o", "out.glb", *ONCE)
    told = [line for line in outcome.err.splitlines() if "strip" in line and "×" in line]
    place = "/meshes/0/primitives/0/mode and 2 more places"
    assert told == [f"3 × triangle strip written as triangles: harmless ({place})"]


def test_a_note_names_the_mesh_and_says_what_to_do(pns, tmp_path):
    turned = {**box(), "NORMAL": -box()["NORMAL"]}
    tree, binary = files.document([box()], [turned])
    tree["meshes"][1]["name"] = "Left arm"
    (tmp_path / "in.glb").write_bytes(files.pack(tree, binary))
    outcome = pns("subdivide", "in.glb", "-o", "out.glb", "--report", "r.json", *ONCE)
    (line,) = [line for line in outcome.err.splitlines() if "points away" in line]
    assert line.endswith(
        "if they show as dark spots use --normals smooth (Left arm, /meshes/1/primitives/0)"
    )
    report = json.loads((tmp_path / "r.json").read_text())
    assert [mesh.get("name") for mesh in report["meshes"]] == [None, "Left arm"]
    assert report["hints"] == {
        "opposed-normals": {
            "text": "if they show as dark spots use normals=smooth",
            "options": ["normals=smooth"],
        }
    }
    outcome = pns("subdivide", "in.glb", "-o", "out.glb", "--normals", "smooth")
    assert "points away" not in outcome.err


def test_a_line_counts_faces_or_triangles(pns, tmp_path):
    quads = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    quads += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    (tmp_path / "in.obj").write_text(quads)
    counts = {"obj": "24 faces", "glb": "48 triangles", "stl": "48 triangles"}
    for target, made in counts.items():
        outcome = pns("subdivide", "in.obj", "-o", f"out.{target}", "--levels", "1")
        assert f"out.{target}: {made} in " in outcome.err
        assert f"; --levels 2 would give {4 * int(made[:2])}\n" in outcome.err
    outcome = pns("subdivide", "in.obj", "-o", "out.obj", "--levels", "6")
    assert "would give" not in outcome.err


ENDINGS = ("glb", "gltf", "obj", "ply", "stl", "off")
# Each format read once and written once: from and to GLB. `make exhaustive` takes all pairs.
PAIRS = [
    pytest.param(a, b, marks=[] if "glb" in (a, b) else [pytest.mark.exhaustive])
    for a in ENDINGS
    for b in ENDINGS
]


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_every_format_becomes_every_other(pns, tmp_path, part_file, source, target):
    given, faces = tmp_path / f"in.{source}", FACES
    if source == "gltf":
        pns("subdivide", "part.glb", "-o", "in.gltf", *ONCE)
        faces = 4 * FACES
    else:
        content = part_file.read_bytes() if source == "glb" else formats.write(part(), source)
        given.write_bytes(content)
    outcome = pns("subdivide", given.name, "-o", f"out.{target}", *ONCE)
    assert outcome.code == 0, outcome.err
    mesh = trimesh.load_scene(tmp_path / f"out.{target}", process=False).to_mesh()
    assert len(mesh.faces) == 4 * faces
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_watertight
    assert mesh.volume > 0


def test_what_a_format_cannot_hold_is_said_and_reported(pns, tmp_path, part_file):
    outcome = pns("subdivide", "part.glb", "-o", "out.stl", "--report", "r.json")
    changes = json.loads((tmp_path / "r.json").read_text())["changes"]
    lost = {change["what"].partition(" dropped")[0] for change in changes}
    assert lost == {"materials", "attribute NORMAL", "attribute TEXCOORD_0"}
    assert all(f"{name} dropped" in outcome.err for name in lost)
    # From one to the next: what is told, and what is not.
    full = ("--diagnostics", "full")
    for source, target, more, told, kept in (
        ("part.glb", "obj", (), None, ["TEXCOORD_0"]),
        ("out.obj", "ply", (), "materials", ["coordinates", "normals"]),
        ("out.ply", "off", full, "attribute _PNS_RATIO", []),
        ("out.off", "stl", (), "texture coordinates", []),
    ):
        err = pns("subdivide", source, "-o", f"out.{target}", *more, *ONCE).err
        assert told is None or f"{told} dropped: not written to {target.upper()} files" in err
        assert not any(word in err for word in kept)


def test_every_loss_is_a_line_once(pns, tmp_path):
    text = "OFF\n5 2 0\n0 0 0\n1 0 0\n0 1 0\n9 9 9\n8 8 8\n3 0 1 2\n3 0 3 3\n"
    (tmp_path / "in.off").write_text(text)
    outcome = pns("subdivide", "in.off", "-o", "out.off", *ONCE)
    assert "1 × degenerate faces dropped: harmless, they have no area\n" in outcome.err
    assert "1 × vertices dropped that no face uses: harmless\n" in outcome.err
    assert "1 × vertices dropped that no face uses: harmless\n" in outcome.err
    assert "duplicate" not in outcome.err
    tree = tree_of_bytes(part_glb())
    indices = tree["accessors"][tree["meshes"][0]["primitives"][0]["indices"]]
    indices["count"] -= 3
    indices["byteOffset"] = 4
    (tmp_path / "in.glb").write_bytes(with_tree(part_glb(), tree))
    outcome = pns("subdivide", "in.glb", "-o", "out.glb", *ONCE)
    assert outcome.err.count("degenerate faces dropped") <= 1


@pytest.mark.parametrize("target", ["glb", "gltf", "ply", "stl"])
def test_what_float32_cannot_tell_apart_is_said(pns, tmp_path, target):
    far = "OFF\n3 1 0\n4500000 0 0\n4500000.2 0 0\n4500000 1 0\n3 0 1 2\n"
    (tmp_path / "far.off").write_text(far)
    assert "float32" in pns("subdivide", "far.off", "-o", f"out.{target}").err
    assert "float32" not in pns("subdivide", "far.off", "-o", "out.obj").err
    (tmp_path / "huge.off").write_text("OFF\n3 1 0\n1e40 0 0\n2e40 0 0\n0 1e40 0\n3 0 1 2\n")
    huge = pns("subdivide", "huge.off", "-o", f"huge.{target}")
    assert huge.code == 1
    assert "float32" in huge.err
    assert "Warning" not in huge.err
    assert not (tmp_path / f"huge.{target}").exists()


def test_texture_coordinates_keep_their_direction(pns, tmp_path):
    (tmp_path / "in.obj").write_bytes(formats.write(part(), "obj"))
    (tmp_path / "in.glb").write_bytes(triangles_glb(part()))
    for source in ("in.obj", "in.glb"):
        for target in ("out.obj", "out.glb"):
            assert pns("subdivide", source, "-o", target, *ONCE).code == 0
            assert pns("subdivide", target, "-o", "last.obj", *ONCE).code == 0
            last = formats.read((tmp_path / "last.obj").read_bytes(), "obj")
            # The section's first point has v = 0 in the example, whatever way it went.
            uv = last.layers["TEXCOORD_0"]
            low = last.vertices[last.corners[np.isclose(uv.values[uv.rows, 1], 0, atol=1e-6)]]
            np.testing.assert_allclose(np.hypot(low[:, 0], low[:, 2]), 0.40, atol=0.03)
            np.testing.assert_allclose(low[:, 1], -0.3, atol=0.06)


def with_tree(glb, tree):
    from service.gltf.read.container import write_glb

    binary = read_glb(glb).binary
    assert binary is not None
    return write_glb(msgspec.json.encode(tree), [binary], [])
