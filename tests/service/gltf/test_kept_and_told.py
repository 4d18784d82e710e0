"""Parts of a file that stay as they were, notes in the report, and the progress that is told."""

import json
import struct

import numpy as np
import pytest

from service.gltf.subdivide import subdivide_gltf
from service.meshfiles.example import part_glb
from service.options import Limits, Options
from service.stages import Stages
from service.workers.progress import STAGES
from tests.service.gltf.read.refused import refusal
from tests.service.gltf.subdivided import corner_positions, subdivide
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import box, octahedron

PRIMITIVE = "/meshes/0/primitives/0"
LINES, POINTS = ({"POSITION": np.eye(3), "mode": mode} for mode in (3, 0))


def refined(tree, binary, **options):
    return subdivide(data=files.pack(tree, binary), **options)


def change(code, what, count=1, pointer="/meshes/0"):
    return {"pointer": pointer, "code": code, "what": what, "count": count}


SECOND = "/meshes/0/primitives/1"


def test_vertices_that_no_refined_face_uses_are_counted_once():
    # Two primitives share the positions; neither uses the last two, one of which is degenerate.
    shape = octahedron()
    shape["POSITION"] = np.concatenate([shape["POSITION"], [[7, 7, 7], [8, 8, 8]]])
    tree, binary = files.document(
        [
            shape | {"indices": shape["indices"][:3]},
            shape | {"indices": np.concatenate([shape["indices"][3:], [[0, 7, 7]]])},
        ]
    )
    first, second = tree["meshes"][0]["primitives"]
    assert refined(tree, binary).report["dropped"]["vertices"] == 2 * 8 - 5 - 6
    second["attributes"] = first["attributes"]
    assert refined(tree, binary).report["dropped"]["vertices"] == 2
    # What points still show is not lost.
    tree["meshes"].append({"primitives": [{"attributes": first["attributes"], "mode": 0}]})
    assert refined(tree, binary).report["dropped"]["vertices"] == 0


def test_a_mesh_without_a_length_is_counted():
    # Morph targets keep the three vertices apart, which lie in one place.
    moved = {"POSITION": np.eye(3), "indices": np.array([[0, 1, 2]])}
    point = {**moved, "POSITION": np.zeros((3, 3)), "targets": [{"POSITION": np.eye(3)}]}
    totals = subdivide([point], [moved], scheme="pns").report["totals"]
    assert totals["zero_reference_lengths"] == 1


@pytest.mark.parametrize(("levels", "count"), [(1, 32), (2, 2 * 128)])
def test_what_float32_is_too_coarse_for_once_it_is_refined_is_told(levels, count):
    """Sides of the first are 11 steps long at level 1; those of the second 181, and 91 at 2."""
    points = octahedron()["POSITION"]
    placed = [size * points + [4.5e6, 0, 0] for size in (8, 128)]
    placed.append(np.add(points, [9, 0, 0]))
    meshes = [[octahedron(POSITION=each)] for each in placed]
    told = subdivide(*meshes, levels=levels).report["changes"]
    assert sum(each["count"] for each in told) == count
    assert [each["pointer"] for each in told] == [
        f"/meshes/{n}/primitives/0" for n in range(levels)
    ]
    assert all("too far from the origin" in each["what"] for each in told)


def test_degenerate_faces_are_dropped_and_reported():
    shape = octahedron()
    shape["indices"] = np.concatenate([[[0, 0, 2]], shape["indices"], [[3, 1, 3]]])
    result = subdivide([shape, octahedron(indices=np.array([[4, 5, 5]]))])
    report = result.report
    assert report["totals"]["faces"] == 32
    assert report["dropped"] == {"degenerate_faces": 3, "duplicate_faces": 0, "vertices": 0}
    assert report["changes"] == [
        change("degenerate-faces", "degenerate faces dropped", 2, PRIMITIVE),
        change(
            "left-as-it-was", "left as it was: no face has an area", 1, "/meshes/0/primitives/1"
        ),
    ]
    before, after = files.unpack(files.glb([shape, shape]))[0], files.unpack(result.glb)[0]
    assert after["meshes"][0]["primitives"][1].keys() == before["meshes"][0]["primitives"][1].keys()
    np.testing.assert_array_equal(
        corner_positions(result.glb), corner_positions(subdivide([octahedron()]).glb)
    )


@pytest.mark.parametrize("diagnostics", ["summary", "full"])
def test_a_mesh_without_any_area_stays_as_it_was(diagnostics):
    points = {"POSITION": np.zeros((3, 3)), "indices": np.array([[0, 1, 2]])}
    given = files.glb([points], [octahedron()])
    result = subdivide(data=given, scheme="pns", diagnostics=diagnostics)
    report = result.report["meshes"][0]
    assert (report["levels"], report["degenerate_faces"]) == ([], 1)
    before, after = files.unpack(given)[0], files.unpack(result.glb)[0]
    assert after["meshes"][0] == before["meshes"][0]
    alone = subdivide([points], scheme="pns").report
    assert (alone["levels"], alone["totals"]["faces"]) == ([], 0)


def test_a_needle_of_coincident_points_keeps_its_report_finite():
    # Faces with three different vertices on a line: no area, but nothing to drop.
    line = {"POSITION": np.outer(np.arange(3.0), [1, 0, 0]), "indices": np.array([[0, 1, 2]])}
    report = subdivide([line], scheme="pns", levels=2).report
    assert json.loads(json.dumps(report, allow_nan=False)) == report


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("roll", [0, 1, 2])
@pytest.mark.parametrize("flip", [False, True])
def test_copies_of_faces_follow_the_faces_that_they_copy(levels, roll, flip):
    shape = octahedron()
    copies = np.roll(shape["indices"][:, ::-1] if flip else shape["indices"], roll, axis=1)
    single = subdivide([shape], levels=levels)
    double = subdivide([shape, octahedron(indices=copies)], levels=levels)
    original, followed = (corner_positions(double.glb, primitive=number) for number in (0, 1))
    np.testing.assert_array_equal(original, corner_positions(single.glb))
    # The same triangles, each block of descendants with the copy's own order of corners.
    for block, other in zip(*(x.reshape(8, -1, 3, 3) for x in (followed, original)), strict=True):
        ours, theirs = ({frozenset(map(tuple, t)) for t in x.tolist()} for x in (block, other))
        assert ours == theirs
    # Each keeps the side that it shows.
    a, b, c = followed.transpose(1, 0, 2)
    side = np.einsum("fi,fi->f", np.cross(b - a, c - a), followed.mean(axis=1))
    assert (side < 0 if flip else side > 0).all()
    assert double.report["totals"]["copied_faces"] == 8
    assert double.report["levels"][-1]["edges"]["irregular"] == 0


def test_points_and_lines_stay_untouched_and_that_is_told():
    before = files.glb([LINES, octahedron(), POINTS], [LINES])
    result = subdivide(data=before)
    tree, old = files.unpack(result.glb)[0], files.unpack(before)[0]
    for number in (0, 2):
        assert tree["meshes"][0]["primitives"][number] == old["meshes"][0]["primitives"][number]
    # Edges drawn over a surface no longer lie on it. Beside none, nothing has moved.
    what = "points and lines left where they were, beside what is refined"
    assert result.report["changes"] == [change("lines-left", what, 2)]


def test_instances_of_a_mesh_are_refined_once():
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    result = refined(tree, binary)
    assert result.report["totals"]["faces"] == 32
    assert result.report["meshes"][0]["instances"] == 2
    assert files.unpack(result.glb)[0]["nodes"] == tree["nodes"]


def test_everything_that_is_no_geometry_stays():
    tree, binary = files.document([box(), octahedron()])
    tree |= {
        "extensionsUsed": ["EXT_unknown"],
        "extensions": {"EXT_unknown": {"deep": [1, 2.5, None, {"é": "\u2028"}]}},
        "extras": "anything",
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
    }
    tree["asset"]["extras"] = {"author": "me", "pns": "old"}
    tree["meshes"][0]["primitives"][1]["extras"] = {"keep": [1]}
    result = subdivide(data=files.pack(tree, binary, [(b"XTRA", b"chunk")]))
    after, new_binary = files.unpack(result.glb)
    assert new_binary[: len(binary)] == binary
    assert result.glb.endswith(files.chunk(b"XTRA", b"chunk", b"\0"))
    for key in ("extensionsUsed", "extensions", "extras", "cameras", "nodes", "scenes", "scene"):
        assert after[key] == tree[key]
    assert after["meshes"][0]["primitives"][1]["extras"] == {"keep": [1]}
    assert after["asset"]["extras"] == {"author": "me", "pns": result.report}


# Buffers


def test_what_goes_with_buffers_that_are_joined_is_told():
    tree, binary = files.document([octahedron()])
    uri = "data:application/octet-stream;base64,AAAAAA=="
    tree["buffers"][0]["name"] = "first"
    tree["buffers"].append({"byteLength": 4, "uri": uri, "name": "second", "extras": 1})
    result = refined(tree, binary)
    assert files.unpack(result.glb)[0]["buffers"][0]["name"] == "first"
    assert result.report["changes"] == [
        change("buffers-joined", "joined into one", 2, "/buffers"),
        change(
            "buffer-properties", "left out, since buffers are one: extras, name", 1, "/buffers/1"
        ),
    ]
    # Who knows the extension would look for a buffer 1.
    tree |= {"extensionsUsed": ["EXT_x"], "extensions": {"EXT_x": {"buffer": 1}}}
    told = change("buffers-numbered", "joined: EXT_x may name them by number", 2, "/buffers")
    assert told in refined(tree, binary).report["changes"]


def test_buffers_are_joined_where_numbers_of_eight_bytes_may_begin():
    # As in tables of EXT_structural_metadata, which readers take for arrays of doubles as they lie.
    tree, binary = files.document([octahedron()])
    binary += bytes(4 + -len(binary) % 8)
    uri = "data:application/octet-stream;base64,AAAAAAAA+D8="
    tree["buffers"] = [{"byteLength": len(binary)}, {"byteLength": 8, "uri": uri}]
    tree["bufferViews"].append({"buffer": 1, "byteLength": 8})
    tree["extensionsUsed"] = ["EXT_structural_metadata"]
    after, content = files.unpack(refined(tree, binary).glb)
    view = after["bufferViews"][len(tree["bufferViews"]) - 1]
    assert view["byteOffset"] % 8 == 0
    assert np.frombuffer(content, "<f8", 1, view["byteOffset"]).tolist() == [1.5]


def test_bin_begins_and_ends_where_numbers_of_eight_bytes_may():
    # EXT_structural_metadata asks for it: with BIN, its tables would lie between such places.
    tree, binary = files.document([octahedron()])
    for length in range(8):
        tree["nodes"][0]["name"] = "a" * length
        glb = refined(tree, binary).glb
        after, text = files.unpack(glb)[0], struct.unpack_from("<I", glb, 12)[0]
        size = after["buffers"][0]["byteLength"]
        assert ((20 + text) % 8, size % 8, len(glb)) == (0, 0, 28 + text + size)


def test_a_buffer_without_bytes_stops_only_what_lies_in_it():
    tree, binary = files.document([octahedron()])
    tree["buffers"] = [{"byteLength": len(binary)}, {"byteLength": 8}]
    assert files.unpack(refined(tree, binary).glb)[0]["buffers"][1:] == []
    tree["bufferViews"].append({"buffer": 1, "byteLength": 8})
    error = refusal(files.pack(tree, binary))
    assert "neither a URI nor a BIN chunk" in error.detail
    assert (error.code, error.pointer) == ("invalid-gltf", "/buffers/1")


# Reports


def test_the_report_lies_in_the_extras_of_the_asset_unless_it_is_not_wanted():
    tree, binary = files.document([octahedron()])
    tree["asset"]["extras"] = ["a", "list"]
    result = refined(tree, binary)
    extras = files.unpack(result.glb)[0]["asset"]["extras"]
    assert extras == {"extras": ["a", "list"], "pns": result.report}
    moved = change("extras-moved", "moved to /asset/extras/extras", 1, "/asset/extras")
    assert result.report["changes"] == [moved]
    result = subdivide([octahedron()], diagnostics="none")
    assert "extras" not in files.unpack(result.glb)[0]["asset"]
    assert result.report["totals"]["faces"] == 32


def test_full_diagnostics_add_ratio_and_gate():
    result = subdivide([octahedron()], scheme="pns", diagnostics="full")
    faces, attributes = files.primitive_of(result.glb)
    for name in ("_PNS_RATIO", "_PNS_GATE"):
        values = attributes[name]
        assert values.shape == (len(attributes["POSITION"]), 1)
        assert values.dtype == np.float32
        # Zero at old vertices: the first corner of each corner child.
        old = faces.reshape(-1, 4, 3)[:, :3, 0]
        assert (values[old] == 0).all()
        assert 0 < values.max() <= 1
    level = result.report["levels"][0]
    assert attributes["_PNS_RATIO"].max() == np.float32(level["proximity_ratio"]["max"])
    plain = subdivide([octahedron()], scheme="pns", normals="keep").glb
    assert set(files.primitive_of(plain)[1]) == {"POSITION"}


def test_totals_are_taken_over_meshes():
    report = subdivide([octahedron()], [box()], [POINTS], scheme="pns", levels=2).report
    assert [mesh["index"] for mesh in report["meshes"]] == [0, 1]
    for level in range(2):
        parts = [mesh["levels"][level] for mesh in report["meshes"]]
        total = report["levels"][level]
        for key in ("vertices", "faces", "degenerate_frames", "flipped_faces"):
            assert total[key] == sum(part[key] for part in parts)
        assert total["gate"]["max"] == max(part["gate"]["max"] for part in parts)
        assert total["normal_jump_max"] == max(part["normal_jump_max"] for part in parts)
        weights = [part["edges"]["interior"] for part in parts]
        means = [part["proximity_ratio"]["mean"] for part in parts]
        assert total["proximity_ratio"]["mean"] == pytest.approx(np.average(means, weights=weights))
    assert (report["scheme"], report["budget"], report["model"]) == ("pns", 0.5, "random")
    assert len(report["model_hash"]) == 64


# Progress


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("compress", ["none", "draco", "meshopt"])
def test_the_share_moves_through_every_stage_and_reaches_its_end(together, compress, monkeypatch):
    if not together:
        monkeypatch.setattr("service.gltf.refine.meshes.MOST_FACES", 0)
    shares, begun = [0.0], []
    stages = Stages(begins=lambda stage: begun.append((stage, shares[-1])), moves=shares.append)
    options = Options(scheme="loop", levels=2, compress=compress)
    data = files.glb([octahedron()], [box()])
    seen = subdivide_gltf(data, "glb", options, None, Limits(), stages)
    assert seen.glb == subdivide_gltf(data, "glb", options, None, Limits()).glb
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1)
    # Each stage begins further on than the one before.
    assert begun == sorted(begun, key=lambda stage: stage[1])
    assert {stage for stage, _ in begun} == set(STAGES) == set(seen.timings)


def test_the_share_moves_inside_the_long_stages():
    """With one mesh alone, progress is told inside the long stages."""
    shares, begun = [0.0], []
    stages = Stages(begins=lambda stage: begun.append((stage, len(shares))), moves=shares.append)
    options = Options(scheme="loop", levels=4)
    subdivide_gltf(part_glb(), "glb", options, None, Limits(), stages)
    ends = [at for _, at in begun[1:]] + [len(shares)]
    moved = {
        stage: len(set(shares[start:end])) for (stage, start), end in zip(begun, ends, strict=True)
    }
    assert moved["refine"] > 20
    assert moved["attributes"] > 20


class EnoughError(Exception):
    pass


@pytest.mark.parametrize("stage", STAGES)
def test_what_the_course_raises_ends_the_work(stage):
    def begins(name):
        if name == stage:
            raise EnoughError

    options = Options(scheme="loop", levels=1)
    with pytest.raises(EnoughError):
        subdivide_gltf(files.glb([box()]), "glb", options, None, Limits(), Stages(begins))


# Accessors and extensions of what is written anew


@pytest.mark.spawning
def test_validator_accepts_every_kind_of_attribute(tmp_path):
    rng = np.random.default_rng(0)
    shape = box(
        COLOR_0=files.Normalized(rng.integers(0, 256, (24, 3), dtype=np.uint8)),
        COLOR_1=rng.random((24, 4)),
        TEXCOORD_1=files.Normalized(rng.integers(0, 65536, (24, 2), dtype=np.uint16)),
        _FEATURE_ID_0=rng.integers(0, 9, (24, 1), dtype=np.uint8),
        _HEAT=rng.random((24, 1)),
    )
    paths = [tmp_path / f"{levels}.glb" for levels in (1, 2)]
    for levels, path in enumerate(paths, start=1):
        options = {"levels": levels, "scheme": "pns", "diagnostics": "full"}
        path.write_bytes(subdivide([shape, octahedron()], **options).glb)
    assert validator.errors(paths) == [[], []]


def accessors_of(tree):
    """Those of the indices and positions of the first primitive."""
    primitive = tree["meshes"][0]["primitives"][0]
    numbers = primitive["indices"], primitive["attributes"]["POSITION"]
    return [tree["accessors"][number] for number in numbers]


@pytest.mark.parametrize("compress", ["none", "draco", "meshopt"])
def test_accessors_that_are_written_anew_keep_name_and_extras(compress):
    tree, binary = files.document([octahedron()])
    said = {"name": "Ecken", "extras": {"from": ["a", 1]}}
    for accessor in accessors_of(tree):
        accessor |= said
    compressed = refined(tree, binary, compress=compress).glb
    # And once more from what was compressed.
    for glb in (compressed, subdivide(data=compressed).glb):
        assert all(each.items() >= said.items() for each in accessors_of(files.unpack(glb)[0]))


def test_extensions_of_accessors_that_are_written_anew_are_told():
    tree, binary = files.document([octahedron()])
    for accessor in accessors_of(tree):
        accessor["extensions"] = {"EXT_x": {"bufferView": 1}}
    told = change(
        "accessors-extended", "left out with the accessors that had them: EXT_x", 2, PRIMITIVE
    )
    assert told in refined(tree, binary).report["changes"]


def test_texture_coordinates_that_become_floats_are_told():
    corners = files.Normalized(np.arange(12, dtype=np.uint16).reshape(6, 2) * 5000)
    result = subdivide([octahedron(TEXCOORD_0=corners)])
    after, _ = files.unpack(result.glb)
    index = after["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    assert after["accessors"][index]["componentType"] == files.COMPONENTS["f4"]
    told = change("quantised", "quantised attributes written as float32", 1, PRIMITIVE)
    assert result.report["changes"] == [told]


@pytest.mark.parametrize(
    "name", ["EXT_mesh_manifold", "EXT_mesh_primitive_restart", "BENTLEY_primitive_restart"]
)
def test_extensions_that_list_vertices_by_number_are_left_out_and_told(name):
    tree, binary = files.document([octahedron()], [POINTS])
    indices = tree["meshes"][0]["primitives"][0]["indices"]
    listed = {name: {"primitiveGroups": [{"primitives": [0], "indices": indices}]}}
    for mesh in tree["meshes"]:
        mesh["extensions"] = listed | {"EXT_other": {}}
    tree["extensionsUsed"] = [name, "EXT_other"]
    result = refined(tree, binary)
    mesh, points = files.unpack(result.glb)[0]["meshes"]
    assert mesh["extensions"] == {"EXT_other": {}}
    assert points["extensions"] == tree["meshes"][1]["extensions"]
    assert (
        change("numbers-of-vertices", f"left out: {name}, by the numbers of vertices")
        in result.report["changes"]
    )
    # What no mesh has any more is not declared.
    del tree["meshes"][0]["extensions"]["EXT_other"], tree["meshes"][1]["extensions"]
    tree["extensionsUsed"] = [name]
    after, _ = files.unpack(refined(tree, binary).glb)
    assert "extensionsUsed" not in after
    assert "extensions" not in after["meshes"][0]
