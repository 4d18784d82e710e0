"""The pipeline by its claims: what comes back, attribute by attribute."""

import json

import numpy as np
import pytest

from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.schemes import loop
from service.options import Limits, Options
from service.subdivide import subdivide_gltf
from service.weld import weld
from tests.networks import random_model
from tests.service.gltf import files, validator
from tests.service.gltf.shapes import box, octahedron


def subdivide(*meshes, data=None, **options):
    data = files.glb(*meshes) if data is None else data
    options = Options(**{"scheme": "loop", **options})
    model = random_model(0) if options.scheme == "pns" else None
    return subdivide_gltf(data, "glb", options, model, Limits())


def corner_positions(data, mesh=0, primitive=0):
    faces, attributes = files.primitive_of(data, mesh, primitive)
    return attributes["POSITION"][faces]


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("shape", [box, octahedron])
def test_positions_are_the_welded_mesh_refined(shape, levels):
    primitive = shape()
    welded = weld(primitive["POSITION"], primitive["indices"].astype(np.int64))
    expected = refine(Mesh(welded.points, welded.faces), loop(), levels).mesh
    actual = corner_positions(subdivide([primitive], levels=levels).glb)
    np.testing.assert_array_equal(actual, expected.vertices[expected.faces].astype(np.float32))


def test_splitting_a_mesh_in_primitives_changes_no_position():
    whole = octahedron()
    halves = [octahedron(indices=whole["indices"][:3]), octahedron(indices=whole["indices"][3:])]
    together = corner_positions(subdivide([whole]).glb)
    apart = subdivide(halves).glb
    joined = [corner_positions(apart, primitive=number) for number in (0, 1)]
    np.testing.assert_array_equal(np.concatenate(joined), together)


def test_unindexed_triangles_are_refined_alike():
    indexed = octahedron()
    loose = {"POSITION": indexed["POSITION"][indexed["indices"].reshape(-1)]}
    np.testing.assert_array_equal(
        corner_positions(subdivide([loose]).glb), corner_positions(subdivide([indexed]).glb)
    )


@pytest.mark.parametrize("stride", [16, 20, 252])
def test_interleaved_positions_are_read_at_their_stride(stride):
    primitive = octahedron()
    tree, binary = files.document([primitive])
    rows = np.zeros((6, stride), dtype=np.uint8)
    rows[:, 4:16] = primitive["POSITION"].astype(np.float32).view(np.uint8).reshape(6, 12)
    start = len(binary) + -len(binary) % 4
    binary = bytes(binary).ljust(start, b"\0") + rows.tobytes()
    tree["buffers"][0]["byteLength"] = len(binary)
    tree["bufferViews"].append(
        {"buffer": 0, "byteOffset": start, "byteLength": rows.size, "byteStride": stride}
    )
    tree["accessors"][0] |= {"bufferView": len(tree["bufferViews"]) - 1, "byteOffset": 4}
    np.testing.assert_array_equal(
        corner_positions(subdivide(data=files.pack(tree, binary)).glb),
        corner_positions(subdivide([primitive]).glb),
    )


@pytest.mark.parametrize("levels", [1, 2])
def test_texture_coordinates_are_linear_in_each_face(levels):
    _, attributes = files.primitive_of(subdivide([box()], levels=levels).glb)
    faces, _ = files.primitive_of(subdivide([box()], levels=levels).glb)
    # On each side of the box the UVs stay the regular grid.
    steps = attributes["TEXCOORD_0"] * 2**levels
    np.testing.assert_array_equal(steps, np.rint(steps))
    # One vertex a distinct corner: each side is a grid of (n + 1)² vertices.
    assert len(attributes["POSITION"]) == 6 * (2**levels + 1) ** 2
    assert faces.max() == len(attributes["POSITION"]) - 1


def test_normals_are_unit_and_hard_edges_stay_hard():
    faces, attributes = files.primitive_of(subdivide([box()], levels=2).glb)
    normals, points = attributes["NORMAL"], attributes["POSITION"]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    corners = points[faces].astype(np.float64)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fci->fc", flat, normals[faces]) > 0).all()
    # Along an edge of the box the two sides keep normals of their own.
    at = weld(points, faces).vertex_of
    counts = [len(np.unique(normals[at == v].round(5), axis=0)) for v in range(at.max() + 1)]
    assert sorted(set(counts)) == [1, 2, 3]
    assert counts.count(3) == 8
    assert counts.count(2) == 12 * 3


def test_normals_are_smooth_across_primitives():
    shape = octahedron()
    shape["NORMAL"] = shape["POSITION"]
    halves = [
        {**shape, "indices": shape["indices"][:4]},
        {**shape, "indices": shape["indices"][4:]},
    ]
    result = subdivide(halves, levels=2).glb
    parts = [files.primitive_of(result, 0, number)[1] for number in (0, 1)]
    normal_at = {}
    for part in parts:
        for point, normal in zip(part["POSITION"].tolist(), part["NORMAL"], strict=True):
            np.testing.assert_array_equal(normal_at.setdefault(tuple(point), normal), normal)
    # A round shape: normals point outwards.
    for part in parts:
        assert (np.einsum("vi,vi->v", part["POSITION"], part["NORMAL"]) > 0).all()


def test_absent_normals_stay_absent():
    _, attributes = files.primitive_of(subdivide([octahedron()]).glb)
    assert set(attributes) == {"POSITION"}


def test_tangents_are_perpendicular_units_with_their_handedness():
    shape = box()
    shape["TANGENT"] = shape["TANGENT"] * np.where(np.arange(24) < 12, 1, -1)[:, None]
    _, attributes = files.primitive_of(subdivide([shape], levels=2).glb)
    tangents, normals = attributes["TANGENT"], attributes["NORMAL"]
    np.testing.assert_allclose(np.linalg.norm(tangents[:, :3], axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(np.einsum("vi,vi->v", tangents[:, :3], normals), 0, atol=1e-6)
    assert np.unique(tangents[:, 3], return_counts=True)[1].tolist() == [75, 75]


def test_useless_normals_and_tangents_become_unit_vectors():
    # Zeros in the file, and faces that cancel out: there is still a normal at every vertex.
    shape = octahedron()
    shape["NORMAL"], shape["TANGENT"] = np.zeros((6, 3)), np.zeros((6, 4))
    shape["TANGENT"][:, 3] = 1
    shape["indices"] = np.concatenate([shape["indices"], shape["indices"][:, ::-1]])
    _, attributes = files.primitive_of(subdivide([shape]).glb)
    for name in ("NORMAL", "TANGENT"):
        lengths = np.linalg.norm(attributes[name][:, :3], axis=1)
        np.testing.assert_allclose(lengths, 1, atol=1e-6)


@pytest.mark.parametrize(("dtype", "full"), [(np.uint8, 255), (np.uint16, 65535)])
@pytest.mark.parametrize("width", [3, 4])
def test_integer_colours_are_averaged_and_keep_their_type(dtype, full, width):
    colours = np.zeros((6, width), dtype=dtype)
    colours[0] = full
    shape = octahedron(COLOR_0=files.Normalized(colours))
    result = subdivide([shape]).glb
    tree, _ = files.unpack(result)
    index = tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
    assert tree["accessors"][index]["normalized"] is True
    _, attributes = files.primitive_of(result)
    assert attributes["COLOR_0"].dtype == dtype
    values, counts = np.unique(attributes["COLOR_0"][:, 0], return_counts=True)
    assert values.tolist() == [0, (full + 1) // 2, full]
    assert counts.tolist() == [13, 4, 1]


def test_float_colours_and_custom_attributes_are_linear():
    rng = np.random.default_rng(0)
    colours, heat = rng.random((6, 4)), rng.random((6, 1))
    shape = octahedron(COLOR_0=colours, _HEAT=heat)
    faces, attributes = files.primitive_of(subdivide([shape]).glb)
    for name, values in (("COLOR_0", colours), ("_HEAT", heat)):
        corners = values[shape["indices"]]
        middle = (corners + np.roll(corners, -1, axis=1)) / 2
        centre_children = attributes[name][faces[3::4]]
        np.testing.assert_allclose(centre_children, middle, atol=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int8, np.int16, np.uint32])
def test_identifiers_are_copied_from_a_nearest_corner(dtype):
    ids = np.arange(10, 16).astype(dtype)[:, None]
    # Beside three bytes of padding, which must not leak into the values.
    faces, attributes = files.primitive_of(subdivide([octahedron(_FEATURE_ID_0=ids)]).glb)
    refined = attributes["_FEATURE_ID_0"]
    assert refined.dtype == dtype
    corner = refined[faces[:, 0]].reshape(-1, 4)[:, :3]
    np.testing.assert_array_equal(corner, ids[octahedron()["indices"], 0])
    assert set(refined[:, 0].tolist()) == set(range(10, 16))


def test_a_seam_in_any_attribute_splits_vertices_and_not_the_surface():
    shape = octahedron()
    flat = shape["indices"].reshape(-1)
    # Every face its own colour: nothing but the position is shared.
    loose = {
        "POSITION": shape["POSITION"][flat],
        "COLOR_0": np.repeat(np.linspace(0, 1, 8), 3)[:, None] * np.ones(3),
    }
    faces, attributes = files.primitive_of(subdivide([loose]).glb)
    assert len(attributes["POSITION"]) == 8 * 6
    np.testing.assert_array_equal(
        attributes["POSITION"][faces], corner_positions(subdivide([shape]).glb)
    )


def test_vertices_that_differ_in_nothing_are_joined():
    loose = {"POSITION": octahedron()["POSITION"][octahedron()["indices"].reshape(-1)]}
    assert len(files.primitive_of(subdivide([loose]).glb)[1]["POSITION"]) == 6 + 12


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
    apart = subdivide(data=files.pack(tree, binary)).report
    assert apart["dropped"]["vertices"] == 2 * 8 - 5 - 6
    second["attributes"] = first["attributes"]
    shared = subdivide(data=files.pack(tree, binary)).report
    assert shared["dropped"]["vertices"] == 2
    # What points still show is not lost.
    tree["meshes"].append({"primitives": [{"attributes": first["attributes"], "mode": 0}]})
    assert subdivide(data=files.pack(tree, binary)).report["dropped"]["vertices"] == 0


def test_a_mesh_without_a_length_is_counted():
    # Morph targets keep the three vertices apart, which lie in one place.
    moved = {"POSITION": np.eye(3), "indices": np.array([[0, 1, 2]])}
    point = {**moved, "POSITION": np.zeros((3, 3)), "targets": [{"POSITION": np.eye(3)}]}
    totals = subdivide([point], [moved], scheme="pns").report["totals"]
    assert totals["zero_reference_lengths"] == 1


def test_degenerate_faces_are_dropped_and_reported():
    shape = octahedron()
    shape["indices"] = np.concatenate([[[0, 0, 2]], shape["indices"], [[3, 1, 3]]])
    result = subdivide([shape, octahedron(indices=np.array([[4, 5, 5]]))])
    assert result.report["totals"]["faces"] == 32
    dropped = {"degenerate_faces": 3, "duplicate_faces": 0, "vertices": 0}
    assert result.report["dropped"] == dropped
    assert result.report["changes"] == [
        {"pointer": "/meshes/0/primitives/0", "what": "degenerate faces dropped", "count": 2},
        {
            "pointer": "/meshes/0/primitives/1",
            "what": "left as it was: no face has an area",
            "count": 1,
        },
    ]
    before, after = files.unpack(files.glb([shape, shape]))[0], files.unpack(result.glb)[0]
    assert after["meshes"][0]["primitives"][1].keys() == before["meshes"][0]["primitives"][1].keys()
    np.testing.assert_array_equal(
        corner_positions(result.glb), corner_positions(subdivide([octahedron()]).glb)
    )


@pytest.mark.parametrize("diagnostics", ["summary", "full"])
def test_a_mesh_without_any_area_stays_as_it_was(diagnostics):
    points = {"POSITION": np.zeros((3, 3)), "indices": np.array([[0, 1, 2]])}
    result = subdivide([points], [octahedron()], scheme="pns", diagnostics=diagnostics)
    report = result.report["meshes"][0]
    assert (report["levels"], report["degenerate_faces"]) == ([], 1)
    before, after = (
        files.unpack(files.glb([points], [octahedron()]))[0],
        files.unpack(result.glb)[0],
    )
    assert after["meshes"][0] == before["meshes"][0]
    alone = subdivide([points], scheme="pns")
    assert alone.report["levels"] == []
    assert alone.report["totals"]["faces"] == 0


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
    original = corner_positions(double.glb, primitive=0)
    np.testing.assert_array_equal(original, corner_positions(single.glb))
    followed = corner_positions(double.glb, primitive=1)
    # The same triangles, each block of descendants with the copy's own order of corners.
    for ours, theirs in zip(
        followed.reshape(8, -1, 3, 3), original.reshape(8, -1, 3, 3), strict=True
    ):
        assert {frozenset(map(tuple, t)) for t in ours.tolist()} == {
            frozenset(map(tuple, t)) for t in theirs.tolist()
        }
    # Each keeps the side that it shows.
    side = np.einsum("fi,fi->f", areas(followed), followed.mean(axis=1))
    assert (side < 0 if flip else side > 0).all()
    assert double.report["totals"]["copied_faces"] == 8
    assert double.report["levels"][-1]["edges"]["irregular"] == 0


def areas(triangles):
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def test_points_and_lines_stay_untouched():
    lines = {"POSITION": np.eye(3), "mode": 3}
    before = files.glb([lines, octahedron(), {"POSITION": np.eye(3), "mode": 0}])
    tree, _ = files.unpack(subdivide(data=before).glb)
    old, _ = files.unpack(before)
    for number in (0, 2):
        primitive = tree["meshes"][0]["primitives"][number]
        assert primitive == old["meshes"][0]["primitives"][number]


def test_instances_of_a_mesh_are_refined_once():
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    result = subdivide(data=files.pack(tree, binary))
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
    data = files.pack(tree, binary, [(b"XTRA", b"chunk")])
    result = subdivide(data=data)
    after, new_binary = files.unpack(result.glb)
    assert new_binary[: len(binary)] == binary
    assert result.glb.endswith(files.chunk(b"XTRA", b"chunk", b"\0"))
    for key in ("extensionsUsed", "extensions", "extras", "cameras", "nodes", "scenes", "scene"):
        assert after[key] == tree[key]
    assert after["meshes"][0]["primitives"][1]["extras"] == {"keep": [1]}
    assert after["asset"]["extras"]["author"] == "me"
    assert after["asset"]["extras"]["pns"] == result.report


def test_extras_that_are_no_object_move_and_are_reported():
    tree, binary = files.document([octahedron()])
    tree["asset"]["extras"] = ["a", "list"]
    result = subdivide(data=files.pack(tree, binary))
    extras = files.unpack(result.glb)[0]["asset"]["extras"]
    assert extras == {"extras": ["a", "list"], "pns": result.report}
    assert result.report["changes"] == [
        {"pointer": "/asset/extras", "what": "moved to /asset/extras/extras", "count": 1}
    ]


def test_without_diagnostics_the_file_has_no_report():
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
    assert set(files.primitive_of(subdivide([octahedron()], scheme="pns").glb)[1]) == {"POSITION"}


def test_many_vertices_get_wide_indices():
    # 105 × 105 quads at level 1: 211² = 44,521 vertices; at level 2: 421² = 177,241.
    n = 106
    x, y = np.meshgrid(np.arange(float(n)), np.arange(n), indexing="ij")
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).reshape(-1, 1)
    faces = np.concatenate([np.add(corner, [0, n, 1]), np.add(corner, [1, n, n + 1])])
    for levels, component in ((1, 5123), (2, 5125)):
        glb = subdivide([{"POSITION": points, "indices": faces}], levels=levels).glb
        tree, _ = files.unpack(glb)
        primitive = tree["meshes"][0]["primitives"][0]
        assert tree["accessors"][primitive["indices"]]["componentType"] == component


def test_positions_carry_their_exact_bounds():
    glb = subdivide([octahedron()], [box()], scheme="pns").glb
    tree, _ = files.unpack(glb)
    for mesh in (0, 1):
        index = tree["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"]
        points = files.primitive_of(glb, mesh)[1]["POSITION"]
        assert tree["accessors"][index]["min"] == points.min(axis=0).tolist()
        assert tree["accessors"][index]["max"] == points.max(axis=0).tolist()


def test_totals_are_taken_over_meshes():
    meshes = [[octahedron()], [box()], [{"POSITION": np.eye(3), "mode": 0}]]
    report = subdivide(*meshes, scheme="pns", levels=2).report
    assert [mesh["index"] for mesh in report["meshes"]] == [0, 1]
    for level in range(2):
        parts = [mesh["levels"][level] for mesh in report["meshes"]]
        total = report["levels"][level]
        for key in ("vertices", "faces", "degenerate_frames", "flipped_faces"):
            assert total[key] == sum(part[key] for part in parts)
        assert total["gate"]["max"] == max(part["gate"]["max"] for part in parts)
        weights = [part["edges"]["interior"] for part in parts]
        means = [part["proximity_ratio"]["mean"] for part in parts]
        assert total["proximity_ratio"]["mean"] == pytest.approx(np.average(means, weights=weights))
    assert (report["scheme"], report["budget"], report["model"]) == ("pns", 0.5, "random")
    assert len(report["model_hash"]) == 64


def test_progress_reaches_its_end():
    calls = []
    subdivide_gltf(
        files.glb([octahedron()], [box()]),
        "glb",
        Options(scheme="loop", levels=2),
        None,
        Limits(),
        lambda done, total: calls.append((done, total)),
    )
    total = (8 + 12) * (4 + 16)
    assert calls == [(32, total), (160, total), (160 + 48, total), (total, total)]


def test_validator_accepts_every_kind_of_attribute(tmp_path):
    rng = np.random.default_rng(0)
    shape = box(
        COLOR_0=files.Normalized(rng.integers(0, 256, (24, 3), dtype=np.uint8)),
        COLOR_1=rng.random((24, 4)),
        TEXCOORD_1=files.Normalized(rng.integers(0, 65536, (24, 2), dtype=np.uint16)),
        _FEATURE_ID_0=rng.integers(0, 9, (24, 1), dtype=np.uint8),
        _HEAT=rng.random((24, 1)),
    )
    path = tmp_path / "refined.glb"
    for levels in (1, 2):
        path.write_bytes(
            subdivide([shape, octahedron()], levels=levels, scheme="pns", diagnostics="full").glb
        )
        assert validator.errors([path]) == [[]]
