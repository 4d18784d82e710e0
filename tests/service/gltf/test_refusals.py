"""Files that break their promises, or ask for what is not refined yet: each with its pointer."""

import base64
import json
import math
import tracemalloc

import numpy as np
import pytest

from service.errors import (
    GltfError,
    LimitError,
    NoModelError,
    UnrefinableError,
    UnsupportedFeature,
)
from service.options import Limits, Options
from service.subdivide import subdivide_gltf
from tests.networks import random_model
from tests.service.gltf import files
from tests.service.gltf.shapes import box, octahedron


def refine(data, media="glb", limits=None, **options):
    options = Options(**{"scheme": "loop", **options})
    return subdivide_gltf(data, media, options, None, limits or Limits())


def edited(edit, *meshes):
    """A GLB whose JSON was edited after it was made."""
    tree, binary = files.document(*(meshes or [[box()]]))
    edit(tree)
    return files.pack(tree, binary)


def put(path, value):
    """An edit: set the value at a JSON pointer."""
    *holders, last = [int(s) if s.isdigit() else s for s in path.split("/")[1:]]

    def edit(tree):
        holder = tree
        for step in holders:
            holder = holder.setdefault(step, {}) if isinstance(holder, dict) else holder[step]
        holder[last] = value

    return edit


BROKEN = [
    ("/asset", {}, "/asset"),
    ("/accessors", {}, "/accessors"),
    ("/accessors/0/count", 0, "/accessors/0/count"),
    ("/accessors/0/count", 2**40, "/accessors/0"),
    ("/accessors/0/componentType", 5124, "/accessors/0/componentType"),
    ("/accessors/0/type", "VEC5", "/accessors/0/type"),
    ("/accessors/0/byteOffset", -4, "/accessors/0/byteOffset"),
    ("/accessors/0/byteOffset", 4, "/accessors/0"),
    ("/accessors/0/bufferView", 99, "/accessors/0/bufferView"),
    ("/accessors/0/type", "VEC4", "/accessors/0"),
    ("/accessors/1/count", 23, "/meshes/0/primitives/0/attributes"),
    ("/bufferViews/0/byteLength", 2**40, "/bufferViews/0"),
    ("/bufferViews/0/byteOffset", 2**63, "/bufferViews/0"),
    ("/bufferViews/0/byteStride", 8, "/accessors/0"),
    ("/bufferViews/0/byteStride", 0, "/bufferViews/0/byteStride"),
    ("/bufferViews/0/buffer", 1, "/bufferViews/0/buffer"),
    ("/buffers/0/byteLength", 2**50, "/buffers/0/byteLength"),
    ("/buffers/0/byteLength", 10, "/bufferViews/0"),
    ("/buffers/0/uri", "data:application/octet-stream;base64,!!!!", "/buffers/0/uri"),
    ("/buffers/0/uri", "data:text/plain,abcd", "/buffers/0/uri"),
    ("/meshes/0/primitives", [], "/meshes/0/primitives"),
    ("/meshes/0/primitives/0/indices", 77, "/meshes/0/primitives/0/indices"),
    ("/meshes/0/primitives/0/indices", 0, "/meshes/0/primitives/0/indices"),
    ("/meshes/0/primitives/0/material", 0, "/meshes/0/primitives/0/material"),
    ("/meshes/0/primitives/0/mode", 7, "/meshes/0/primitives/0/mode"),
    ("/meshes/0/primitives/0/attributes/A~b", 99, "/meshes/0/primitives/0/attributes/A~0b"),
    ("/nodes/0/mesh", 1, "/nodes/0/mesh"),
    ("/nodes/0/skin", 0, "/nodes/0/skin"),
    ("/nodes/0/camera", 0, "/nodes/0/camera"),
    ("/nodes/0/children", [0], "/nodes/0"),
    ("/nodes/0/children", [5], "/nodes/0/children/0"),
    ("/nodes", [{"mesh": 0, "children": [1]}, {"children": [0]}], "/nodes/0"),
    ("/nodes", [{"children": [2]}, {"children": [2]}, {"mesh": 0}], "/nodes/1/children/0"),
    ("/nodes", [{"children": [1, 1]}, {"mesh": 0}], "/nodes/0/children/1"),
    ("/scene", 1, "/scene"),
    ("/scenes/0/nodes", [9], "/scenes/0/nodes/0"),
    ("/textures", [{"source": 0}], "/textures/0/source"),
    ("/textures", [{"sampler": 0}], "/textures/0/sampler"),
    ("/materials", [{"normalTexture": {"index": 0}}], "/materials/0/normalTexture/index"),
    ("/images", [{"bufferView": 50}], "/images/0/bufferView"),
    ("/skins", [{"joints": [4]}], "/skins/0/joints/0"),
    ("/skins", [{"joints": [0], "skeleton": 4}], "/skins/0/skeleton"),
    (
        "/animations",
        [{"samplers": [{"input": 0, "output": 99}], "channels": []}],
        "/animations/0/samplers/0/output",
    ),
    (
        "/animations",
        [{"samplers": [], "channels": [{"sampler": 0, "target": {}}]}],
        "/animations/0/channels/0/sampler",
    ),
    (
        "/accessors/0/sparse",
        {
            "count": 25,
            "indices": {"bufferView": 0, "componentType": 5123},
            "values": {"bufferView": 0},
        },
        "/accessors/0/sparse/count",
    ),
    (
        "/accessors/0/sparse",
        {
            "count": 24,
            "indices": {"bufferView": 0, "componentType": 5123, "byteOffset": 280},
            "values": {"bufferView": 0},
        },
        "/accessors/0/sparse/indices",
    ),
    (
        "/bufferViews/0/extensions",
        {"EXT_meshopt_compression": {"buffer": 0}},
        "/bufferViews/0/extensions/EXT_meshopt_compression",
    ),
    (
        "/meshes/0/primitives/0/extensions",
        {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}},
        "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression",
    ),
    ("/accessors/4/count", 35, "/meshes/0/primitives/0"),
    ("/accessors/0/type", "SCALAR", "/accessors/0/type"),
]


@pytest.mark.parametrize(("path", "value", "pointer"), BROKEN)
def test_a_broken_promise_is_refused_with_its_pointer(path, value, pointer):
    with pytest.raises(GltfError) as refusal:
        refine(edited(put(path, value)))
    assert refusal.value.pointer == pointer
    assert (refusal.value.status, refusal.value.code) == (422, "invalid-gltf")


def test_an_index_beyond_the_vertices_is_refused():
    faces = octahedron()["indices"].copy()
    faces[3, 1] = 6
    with pytest.raises(GltfError, match="index 6, but there are 6") as refusal:
        refine(files.glb([octahedron(indices=faces)]))
    assert refusal.value.pointer == "/accessors/1"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(("place", "name"), [(0, "POSITION"), (1, "NORMAL"), (2, "TANGENT")])
def test_values_that_are_not_finite_are_refused(place, name, value):
    shape = box()
    shape[name] = shape[name].copy()
    shape[name][7, 1] = value
    tree, binary = files.document([shape])
    for accessor in tree["accessors"]:
        accessor.pop("min", None), accessor.pop("max", None)
    with pytest.raises(GltfError, match=name) as refusal:
        refine(files.pack(tree, binary))
    assert refusal.value.pointer == f"/accessors/{place}"


UNSUPPORTED = [
    ("/asset/version", "1.0", "glTF version 1.0"),
    ("/meshes/0/primitives/0/attributes", {"NORMAL": 1}, "a primitive without POSITION"),
    (
        "/meshes/0/primitives/0/extensions",
        {"CESIUM_primitive_outline": {"indices": 4}},
        "CESIUM_primitive_outline",
    ),
]


@pytest.mark.parametrize(("path", "value", "feature"), UNSUPPORTED)
def test_what_cannot_be_refined_yet_is_refused_by_name(path, value, feature):
    with pytest.raises(UnsupportedFeature) as refusal:
        refine(edited(put(path, value)))
    assert refusal.value.feature == feature
    assert refusal.value.pointer.startswith(path)
    assert (refusal.value.status, refusal.value.code) == (422, "unsupported-feature")


JOINTS, SHARES = np.zeros((24, 4), dtype=np.uint8), np.full((24, 4), 0.25)


@pytest.mark.parametrize(
    ("attributes", "pointer"),
    [
        ({"JOINTS_0": JOINTS}, "/meshes/0/primitives/0/attributes/JOINTS_0"),
        ({"WEIGHTS_1": SHARES}, "/meshes/0/primitives/0/attributes/WEIGHTS_1"),
        ({"JOINTS_0": SHARES, "WEIGHTS_0": SHARES}, "/accessors/5/componentType"),
        ({"JOINTS_0": JOINTS, "WEIGHTS_0": JOINTS}, "/accessors/6/componentType"),
        ({"JOINTS_0": JOINTS[:, :3], "WEIGHTS_0": SHARES}, "/accessors/5/type"),
        ({"JOINTS_0": JOINTS, "WEIGHTS_0": SHARES - 0.5}, "/accessors/6"),
        ({"JOINTS_0": JOINTS, "WEIGHTS_0": SHARES * np.nan}, "/accessors/6"),
        ({"targets": [{"TANGENT": np.zeros((24, 4))}]}, "/accessors/5/type"),
        ({"targets": [{"POSITION": np.full((24, 3), np.inf)}]}, "/accessors/5"),
    ],
)
def test_wrong_skins_and_targets_are_refused_with_a_pointer(attributes, pointer):
    tree, binary = files.document([box(**attributes)])
    for accessor in tree["accessors"]:
        accessor.pop("min", None), accessor.pop("max", None)
    with pytest.raises(GltfError) as refusal:
        refine(files.pack(tree, binary))
    assert refusal.value.pointer == pointer


def test_weights_of_several_types_are_refused_by_name():
    skin = {"JOINTS_0": JOINTS, "WEIGHTS_0": SHARES, "JOINTS_1": JOINTS}
    skin["WEIGHTS_1"] = files.Normalized(JOINTS)
    with pytest.raises(UnsupportedFeature, match="different component types") as refusal:
        refine(files.glb([box(**skin)]))
    assert refusal.value.pointer == "/meshes/0/primitives/0/attributes"


def test_a_deep_tree_of_nodes_is_no_cycle():
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"children": [number + 1]} for number in range(20_000)] + [{"mesh": 0}]
    assert refine(files.pack(tree, binary)).report["totals"]["faces"] == 32
    tree["nodes"][-1]["children"] = [0]
    with pytest.raises(GltfError, match="ancestor"):
        refine(files.pack(tree, binary))


def test_uris_of_images_are_neither_followed_nor_lost():
    uris = ["../../etc/passwd", "https://example.com/a.png", "data:image/png;base64,AAAA"]
    images = [{"uri": uri} for uri in uris]
    result = refine(edited(put("/images", images)))
    assert files.unpack(result.glb)[0]["images"] == images


def test_an_accessor_without_bytes_allocates_nothing():
    # Four billion points that the file does not hold: glTF reads them as zeros.
    def edit(tree):
        for accessor in tree["accessors"][:4]:
            accessor.update(count=2**32)
        del tree["accessors"][0]["bufferView"]

    with pytest.raises((GltfError, UnsupportedFeature)):
        refine(edited(edit))


def test_colours_of_plain_integers_are_refused():
    shape = octahedron(COLOR_0=np.zeros((6, 4), dtype=np.uint8))
    with pytest.raises(GltfError, match="normalized"):
        refine(files.glb([shape]))


@pytest.mark.parametrize("mesh", [[], [[{"POSITION": np.eye(3), "mode": 0}]]])
def test_a_file_without_triangles_cannot_be_refined(mesh):
    with pytest.raises(UnrefinableError):
        refine(files.glb(*mesh))


def test_predicted_faces_are_checked_at_the_limit():
    data = files.glb([octahedron()], [octahedron(), octahedron()])
    limits = Limits(max_faces=3 * 8 * 16)
    assert refine(data, levels=2, limits=limits).report["totals"]["faces"] == 384
    with pytest.raises(LimitError) as refusal:
        refine(data, levels=2, limits=Limits(max_faces=383))
    assert (refusal.value.limit, refusal.value.found) == ("faces", 384)
    assert refusal.value.status == 413


def test_predicted_memory_is_checked():
    with pytest.raises(LimitError) as refusal:
        refine(files.glb([octahedron()]), levels=6, limits=Limits(max_memory_bytes=2**20))
    assert refusal.value.limit == "memory"


@pytest.mark.parametrize("levels", [1, 3])
@pytest.mark.parametrize("smooth", [True, False])
def test_predicted_memory_bounds_what_is_used(levels, smooth):
    # Noise over a grid; smooth shares every vertex, the other has one for each corner.
    n = 64 // 2 ** (levels - 1)
    x, y = np.meshgrid(np.arange(float(n + 1)), np.arange(n + 1), indexing="ij")
    height = np.random.default_rng(0).random(x.size)
    points = np.stack([x.reshape(-1), y.reshape(-1), height], axis=1)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1, 1)
    faces = np.concatenate([np.add(corner, [0, n + 1, 1]), np.add(corner, [1, n + 1, n + 2])])
    if not smooth:
        points, faces = points[faces.reshape(-1)], np.arange(faces.size).reshape(-1, 3)
    shape = {
        "POSITION": points,
        "NORMAL": np.random.default_rng(1).standard_normal((len(points), 3)),
        "TEXCOORD_0": points[:, :2],
        "indices": faces,
    }
    data = files.glb([shape])
    refine(files.glb([octahedron()]), levels=levels)
    tracemalloc.start()
    try:
        refine(data, levels=levels, diagnostics="full")
        used = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    with pytest.raises(LimitError) as refusal:
        refine(data, levels=levels, limits=Limits(max_memory_bytes=used))
    assert used < refusal.value.found < 4 * used


def test_many_primitives_over_one_large_accessor_count_as_they_cost():
    # 400 triangles that share 60,000 vertices: work in proportion to the triangles.
    points = np.random.default_rng(0).standard_normal((60_000, 3))
    tree, binary = files.document([{"POSITION": points, "indices": np.array([[0, 1, 2]])}])
    tree["meshes"][0]["primitives"] *= 400
    report = refine(files.pack(tree, binary), limits=Limits(max_memory_bytes=64 * 2**20)).report
    assert report["totals"]["faces"] == 1600


def test_positions_up_to_the_end_of_float32_are_refined():
    shape = octahedron()
    shape["POSITION"] = shape["POSITION"] * 3.4e38
    assert refine(files.glb([shape]), levels=2).report["totals"]["faces"] == 128


def test_positions_that_leave_float32_are_refused():
    shape = octahedron()
    shape["POSITION"] = shape["POSITION"] * 3e38
    with pytest.raises(UnrefinableError) as refusal:
        subdivide_gltf(
            files.glb([shape]), "glb", Options(budget=1e4, levels=2), random_model(0), Limits()
        )
    assert refusal.value.pointer == "/meshes/0"


def test_the_learned_scheme_needs_a_model():
    with pytest.raises(NoModelError):
        refine(files.glb([octahedron()]), scheme="pns")


def test_buffers_in_data_uris_are_read_and_joined():
    tree, binary = files.document([box()], [octahedron()])
    cut = tree["bufferViews"][5]["byteOffset"]
    parts = [bytes(binary[:cut]), bytes(binary[cut:])]
    for view in tree["bufferViews"][5:]:
        view["buffer"], view["byteOffset"] = 1, view["byteOffset"] - cut
    tree["buffers"] = [
        {
            "byteLength": len(part),
            "uri": "data:application/gltf-buffer;base64," + base64.b64encode(part).decode(),
        }
        for part in parts
    ]
    result = refine(json.dumps(tree).encode(), media="gltf")
    whole = refine(files.glb([box()], [octahedron()]))
    for mesh in (0, 1):
        faces, attributes = files.primitive_of(result.glb, mesh)
        expected_faces, expected = files.primitive_of(whole.glb, mesh)
        np.testing.assert_array_equal(faces, expected_faces)
        for name, values in expected.items():
            np.testing.assert_array_equal(attributes[name], values)
    after, _ = files.unpack(result.glb)
    assert len(after["buffers"]) == 1
    assert "uri" not in after["buffers"][0]
    assert result.report["changes"] == [
        {"pointer": "/buffers", "what": "joined into one", "count": 2}
    ]


def test_a_buffer_without_bytes_is_refused():
    tree, _ = files.document([box()])
    with pytest.raises(GltfError, match="neither") as refusal:
        refine(json.dumps(tree).encode(), media="gltf")
    assert refusal.value.pointer == "/buffers/0"
