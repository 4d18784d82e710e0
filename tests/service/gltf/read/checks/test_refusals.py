"""Files that break their own promises or hold what cannot be refined are refused with a pointer."""

import math

import numpy as np
import pytest

from service.errors import (
    GltfError,
    UnrefinableError,
    UnsupportedFeature,
)
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron


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
    ("/bufferViews/0/byteOffset", 2**63, "/bufferViews/0/byteOffset"),
    ("/bufferViews/0/byteOffset", 10**200, "/bufferViews/0/byteOffset"),
    ("/accessors/0/count", 10**308, "/accessors/0/count"),
    ("/bufferViews/0/byteStride", 8, "/accessors/0"),
    ("/bufferViews/0/byteStride", -4, "/bufferViews/0/byteStride"),
    ("/bufferViews/0/byteStride", 2**53, "/accessors/0"),
    ("/bufferViews/0/buffer", 1, "/bufferViews/0/buffer"),
    ("/buffers/0/byteLength", 2**50, "/buffers/0/byteLength"),
    ("/buffers/0/byteLength", 10, "/bufferViews/0"),
    ("/buffers/0/uri", "data:application/octet-stream;base64,!!!!", "/buffers/0/uri"),
    ("/buffers/0/uri", "data:text/plain,abcd", "/buffers/0/uri"),
    ("/meshes/0/primitives", {}, "/meshes/0/primitives"),
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
    ("/nodes", [{"mesh": 0}, {"children": [2, 2]}, {"children": [1]}], "/nodes/1"),
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


@pytest.mark.parametrize(
    ("nodes", "pointer", "count"),
    [
        ([{"children": [2]}, {"children": [2]}, {"mesh": 0}], "/nodes/1/children/0", 1),
        ([{"children": [1, 1, 1]}, {"mesh": 0}], "/nodes/0/children/1", 2),
    ],
)
def test_a_node_with_several_parents_is_reported_and_left(nodes, pointer, count):
    changes = refine(edited(put("/nodes", nodes))).report["changes"]
    what = "found, and left: nodes with more than one parent"
    assert {"pointer": pointer, "code": "breach", "what": what, "count": count} in changes


@pytest.mark.parametrize(
    "name",
    ["JOINTS_00", "WEIGHTS_01", "JOINTS_٣", "WEIGHTS_²", "JOINTS_" + "9" * 4301, "JOINTS_1000"],
)
def test_a_set_of_joints_has_a_plain_number(name):
    def edit(tree):
        attributes = tree["meshes"][0]["primitives"][0]["attributes"]
        attributes[name] = attributes["POSITION"]

    with pytest.raises(GltfError) as refusal:
        refine(edited(edit))
    assert refusal.value.pointer == f"/meshes/0/primitives/0/attributes/{name}"


def test_an_index_beyond_the_vertices_is_refused():
    faces = octahedron()["indices"].copy()
    faces[3, 1] = 6
    with pytest.raises(GltfError, match="index 6, but there are 6") as refusal:
        refine(files.glb([octahedron(indices=faces)]))
    assert refusal.value.pointer == "/accessors/1"


def test_a_strip_of_two_corners_is_refused():
    with pytest.raises(GltfError, match="2 corners make no triangle"):
        refine(files.glb([octahedron(indices=np.array([0, 2]), mode=5)]))


@pytest.mark.parametrize(("kind", "restart"), [(np.uint8, 255), (np.uint16, 65535)])
def test_strips_and_fans_with_restarts_are_refused_by_name(kind, restart):
    for mode in (5, 6):
        indices = np.array([0, 2, 4, restart, 1, 3, 5], dtype=kind)
        with pytest.raises(UnsupportedFeature, match="a strip or fan with restarts") as refusal:
            refine(files.glb([octahedron(indices=indices, mode=mode)]))
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
    with pytest.raises(GltfError, match=f"^/meshes/0/primitives/0/attributes/{name} ") as refusal:
        refine(files.pack(tree, binary))
    assert refusal.value.pointer == f"/accessors/{place}"


UNSUPPORTED = [
    ("/asset/version", "1.0", "glTF version 1.0"),
    ("/asset/minVersion", "2.1", "what needs glTF version 2.1 at least"),
    ("/meshes/0/primitives/0/attributes", {"NORMAL": 1}, "a primitive without POSITION"),
    (
        "/meshes/0/primitives/0/extensions",
        {"EXT_mesh_primitive_edge_visibility": {"visibility": 4}},
        "EXT_mesh_primitive_edge_visibility",
    ),
    (
        "/meshes/0/primitives/0/extensions",
        {"EXT_mesh_features": {"featureIds": [{"featureCount": 24}]}},
        "EXT_mesh_features by the numbers of vertices",
    ),
]


@pytest.mark.parametrize(("path", "value", "feature"), UNSUPPORTED)
def test_what_cannot_be_refined_yet_is_refused_by_name(path, value, feature):
    with pytest.raises(UnsupportedFeature) as refusal:
        refine(edited(put(path, value)))
    assert refusal.value.feature == feature
    assert refusal.value.pointer.startswith(path)
    assert (refusal.value.status, refusal.value.code) == (422, "unsupported-feature")


def test_positions_that_an_unknown_extension_holds_are_refused_by_its_name():
    def edit(tree):
        del tree["accessors"][0]["bufferView"]
        tree["meshes"][0]["primitives"][0]["extensions"] = {"ACME_compression": {"view": 4}}

    with pytest.raises(UnsupportedFeature, match="positions lie in ACME_compression") as refusal:
        refine(edited(edit))
    assert refusal.value.pointer == "/meshes/0/primitives/0/extensions"


def test_the_version_is_refused_whatever_else_the_document_has():
    # As glTF 1.0 wrote it: by names, where 2.0 counts.
    first = {"asset": {"version": "1.0"}, "accessors": {"a": {}}, "meshes": {}, "scene": "s"}
    with pytest.raises(UnsupportedFeature, match=r"glTF version 1\.0"):
        refine(files.pack(first))
    with pytest.raises(GltfError, match="version") as refusal:
        refine(files.pack({"meshes": {}}))
    assert refusal.value.pointer == "/asset"


def test_features_that_do_not_go_by_the_numbers_of_vertices_are_taken():
    sets = [{"featureCount": 3, "attribute": 0}, {"featureCount": 3, "texture": {"index": 0}}]
    extensions = {"EXT_mesh_features": {"featureIds": sets}}
    result = refine(edited(put("/meshes/0/primitives/0/extensions", extensions)))
    tree, _ = files.unpack(result.glb)
    assert tree["meshes"][0]["primitives"][0]["extensions"] == extensions


JOINTS, SHARES = np.zeros((24, 4), dtype=np.uint8), np.full((24, 4), 0.25)


@pytest.mark.parametrize(
    ("attributes", "pointer"),
    [
        ({"JOINTS_0": JOINTS}, "/meshes/0/primitives/0/attributes/JOINTS_0"),
        ({"NORMAL": np.zeros((24, 3), dtype=np.uint8)}, "/accessors/1/componentType"),
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


@pytest.mark.parametrize("mesh", [[], [[{"POSITION": np.eye(3), "mode": 0}]]])
def test_a_file_without_triangles_cannot_be_refined(mesh):
    with pytest.raises(UnrefinableError):
        refine(files.glb(*mesh))
