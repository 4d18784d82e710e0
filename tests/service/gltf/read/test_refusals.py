"""Files that break their promises or hold what cannot be refined: code, pointer and words."""

import json
import math
import struct
from time import perf_counter

import DracoPy
import numpy as np
import pytest

from benchmarks.memory import peak_mib, reset_peak
from service.options import Limits
from tests.fuzz.seeds import compressed_views, draco
from tests.service.gltf.read.refused import refine, refusal
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.memory import most_of

PRIMITIVE = "/meshes/0/primitives/0"
ATTRIBUTES, EXTENSIONS = f"{PRIMITIVE}/attributes", f"{PRIMITIVE}/extensions"
DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"
UNREADABLE, INVALID, UNSUPPORTED = "unreadable", "invalid-gltf", "unsupported-feature"
LIMIT, UNREFINABLE = "limit-exceeded", "unrefinable-mesh"


def put(tree, path, value):
    """Set the value at a JSON pointer."""
    *holders, last = [int(step) if step.isdigit() else step for step in path.split("/")[1:]]
    for step in holders:
        tree = tree.setdefault(step, {}) if isinstance(tree, dict) else tree[step]
    tree[last] = value


def edited(path, value):
    """A box of 24 vertices with one value of its JSON set."""
    tree, binary = files.document([box()])
    put(tree, path, value)
    return files.pack(tree, binary)


def sparse(count, **indices):
    places = {"bufferView": 0, "componentType": 5123, **indices}
    return {"count": count, "indices": places, "values": {"bufferView": 0}}


def animation(sampler, channels=()):
    return [{"samplers": sampler, "channels": list(channels)}]


def features(value):
    return {"EXT_mesh_features": {"featureIds": [value]}}


# What is set to what, and where that is told if not at the value itself.
BROKEN = [
    ("/asset", {}),
    ("/accessors", {}),
    ("/accessors/0/count", 0),
    ("/accessors/0/count", 1.5),
    ("/accessors/0/count", 2.0**60),
    ("/accessors/0/count", -1.0),
    ("/accessors/0/count", 10**308),
    ("/accessors/0/count", 2**40, "/accessors/0"),
    ("/accessors/1/count", 23, ATTRIBUTES),
    ("/accessors/4/count", 35, PRIMITIVE),
    ("/accessors/0/componentType", 5124),
    ("/accessors/0/type", "VEC5"),
    ("/accessors/0/type", "SCALAR"),
    ("/accessors/0/type", "VEC4", "/accessors/0"),
    ("/accessors/0/byteOffset", -4),
    ("/accessors/0/byteOffset", 4, "/accessors/0"),
    ("/accessors/0/bufferView", 99),
    ("/accessors/0/sparse", sparse(25), "/accessors/0/sparse/count"),
    ("/accessors/0/sparse", sparse(24, byteOffset=280), "/accessors/0/sparse/indices"),
    ("/bufferViews/0/byteLength", 2**40, "/bufferViews/0"),
    ("/bufferViews/0/byteOffset", 2**63),
    ("/bufferViews/0/byteOffset", 10**200),
    ("/bufferViews/0/byteStride", 8, "/accessors/0"),
    ("/bufferViews/0/byteStride", -4),
    ("/bufferViews/0/byteStride", 2**53, "/accessors/0"),
    ("/bufferViews/0/buffer", 1),
    ("/bufferViews/0/extensions", {MESHOPT: {"buffer": 0}}, f"/bufferViews/0/extensions/{MESHOPT}"),
    ("/buffers/0/byteLength", 2**50),
    ("/buffers/0/byteLength", 10, "/bufferViews/0"),
    ("/buffers/0/uri", "data:application/octet-stream;base64,!!!!"),
    ("/buffers/0/uri", "data:text/plain,abcd"),
    ("/meshes/0/primitives", {}),
    (f"{PRIMITIVE}/indices", 77),
    (f"{PRIMITIVE}/indices", 0),
    (f"{PRIMITIVE}/material", 0),
    (f"{PRIMITIVE}/mode", 7),
    (f"{ATTRIBUTES}/A~b", 99, f"{ATTRIBUTES}/A~0b"),
    # A set of joints has a plain number.
    *((f"{ATTRIBUTES}/{name}", 0) for name in ("JOINTS_00", "WEIGHTS_01", "JOINTS_٣", "WEIGHTS_²")),
    *((f"{ATTRIBUTES}/{name}", 0) for name in ("JOINTS_" + "9" * 4301, "JOINTS_1000")),
    (EXTENSIONS, {DRACO: {"bufferView": 0, "attributes": {}}}, f"{EXTENSIONS}/{DRACO}"),
    ("/nodes/0/mesh", 1),
    ("/nodes/0/skin", 0),
    ("/nodes/0/camera", 0),
    ("/nodes/0/children", [0], "/nodes/0"),
    ("/nodes/0/children", [5], "/nodes/0/children/0"),
    ("/nodes", [{"mesh": 0, "children": [1]}, {"children": [0]}], "/nodes/0"),
    ("/nodes", [{"mesh": 0}, {"children": [2, 2]}, {"children": [1]}], "/nodes/1"),
    ("/scene", 1),
    ("/scenes/0/nodes", [9], "/scenes/0/nodes/0"),
    ("/textures", [{"source": 0}], "/textures/0/source"),
    ("/textures", [{"sampler": 0}], "/textures/0/sampler"),
    ("/materials", [{"normalTexture": {"index": 0}}], "/materials/0/normalTexture/index"),
    ("/images", [{"bufferView": 50}], "/images/0/bufferView"),
    ("/skins", [{"joints": [4]}], "/skins/0/joints/0"),
    ("/skins", [{"joints": [0], "skeleton": 4}], "/skins/0/skeleton"),
    ("/animations", animation([{"input": 0, "output": 99}]), "/animations/0/samplers/0/output"),
    (
        "/animations",
        animation([], [{"sampler": 0, "target": {}}]),
        "/animations/0/channels/0/sampler",
    ),
]


@pytest.mark.parametrize("row", BROKEN, ids=lambda row: f"{row[0]} = {row[1]}"[:70])
def test_a_broken_promise_is_refused_with_its_pointer(row):
    path, value, *place = row
    error = refusal(edited(path, value))
    assert (error.status, error.code, error.pointer) == (422, INVALID, (place or [path])[0])


@pytest.mark.parametrize(
    ("path", "value", "feature"),
    [
        ("/asset/version", "1.0", "glTF version 1.0"),
        ("/asset/minVersion", "2.1", "what needs glTF version 2.1 at least"),
        (ATTRIBUTES, {"NORMAL": 1}, "a primitive without POSITION"),
        *(
            (EXTENSIONS, {name: value}, name + more)
            for name, value, more in (
                ("EXT_mesh_primitive_edge_visibility", {"visibility": 4}, ""),
                ("EXT_mesh_features", {"featureIds": [{}]}, " by the numbers of vertices"),
            )
        ),
    ],
)
def test_what_cannot_be_refined_yet_is_refused_by_name(path, value, feature):
    error = refusal(edited(path, value))
    assert (error.status, error.code, error.feature) == (422, UNSUPPORTED, feature)
    assert error.pointer.startswith(path)


def of(shape, **changes):
    """A file of a shape with other attributes, whose bounds are not stated."""
    tree, binary = files.document([shape | changes])
    for accessor in tree["accessors"]:
        accessor.pop("min", None), accessor.pop("max", None)
    return files.pack(tree, binary)


def with_one(name, value):
    values = box()[name].copy()
    values[7, 1] = value
    return of(box(), **{name: values})


def restarted(kind, restart, mode):
    return of(octahedron(), indices=np.array([0, 2, 4, restart, 1, 3, 5], dtype=kind), mode=mode)


def held_by_an_extension():
    tree, binary = files.document([box()])
    del tree["accessors"][0]["bufferView"]
    put(tree, EXTENSIONS, {"ACME_compression": {"view": 4}})
    return files.pack(tree, binary)


def replaced(places):
    """An octahedron, of whose positions a sparse accessor gives some anew."""
    tree, binary = files.document([octahedron()])
    rows = files.add_accessor(tree, binary, np.array(places, dtype=np.uint16).reshape(-1, 1))
    values = files.add_accessor(tree, binary, np.zeros((2, 3)))
    views = [tree["accessors"][index]["bufferView"] for index in (rows, values)]
    tree["buffers"] = [{"byteLength": len(binary)}]
    tree["accessors"][0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    return files.pack(tree, bytes(binary))


def row(name, data, code, place=None, says=""):
    """A file, and its refusal: by code, by pointer or limit, and by words."""
    return pytest.param(data, code, place, says, id=name)


JOINTS, SHARES = np.zeros((24, 4), dtype=np.uint8), np.full((24, 4), 0.25)
SKIN = {"JOINTS_0": JOINTS, "WEIGHTS_0": SHARES}
TWO = {**SKIN, "JOINTS_1": JOINTS, "WEIGHTS_1": files.Normalized(JOINTS)}
BEYOND, PAIR = np.where(octahedron()["indices"] == 5, 6, 5), np.array([0, 2])
# As glTF 1.0 wrote it: by names, where 2.0 counts.
FIRST = {"asset": {"version": "1.0"}, "accessors": {"a": {}}, "meshes": {}, "scene": "s"}
GEOMETRY = [
    row(
        "beyond",
        of(octahedron(), indices=BEYOND),
        INVALID,
        "/accessors/1",
        "index 6, but there are 6",
    ),
    row("short strip", of(octahedron(), indices=PAIR, mode=5), INVALID, None, "2 corners make no"),
    *(
        row("restart", restarted(kind, last, mode), UNSUPPORTED, "/accessors/1", "with restarts")
        for kind, last in ((np.uint8, 255), (np.uint16, 65535))
        for mode in (5, 6)
    ),
    *(
        row(
            f"{name} {value}",
            with_one(name, value),
            INVALID,
            f"/accessors/{n}",
            f"{ATTRIBUTES}/{name} ",
        )
        for n, name in enumerate(("POSITION", "NORMAL", "TANGENT"))
        for value in (math.nan, math.inf, -math.inf)
    ),
    *(
        row("skin or target", of(box(), **given), INVALID, pointer)
        for given, pointer in (
            ({"JOINTS_0": JOINTS}, f"{ATTRIBUTES}/JOINTS_0"),
            ({"NORMAL": JOINTS[:, :3]}, "/accessors/1/componentType"),
            ({"WEIGHTS_1": SHARES}, f"{ATTRIBUTES}/WEIGHTS_1"),
            (SKIN | {"JOINTS_0": SHARES}, "/accessors/5/componentType"),
            (SKIN | {"WEIGHTS_0": JOINTS}, "/accessors/6/componentType"),
            (SKIN | {"JOINTS_0": JOINTS[:, :3]}, "/accessors/5/type"),
            (SKIN | {"WEIGHTS_0": SHARES - 0.5}, "/accessors/6"),
            (SKIN | {"WEIGHTS_0": SHARES * np.nan}, "/accessors/6"),
            ({"targets": [{"TANGENT": np.zeros((24, 4))}]}, "/accessors/5/type"),
            ({"targets": [{"POSITION": np.full((24, 3), np.inf)}]}, "/accessors/5"),
        )
    ),
    row(
        "weights of two types",
        of(box(), **TWO),
        UNSUPPORTED,
        ATTRIBUTES,
        "different component types",
    ),
    row("positions elsewhere", held_by_an_extension(), UNSUPPORTED, EXTENSIONS, "ACME_compression"),
    *(
        row("sparse", replaced(places), INVALID, "/accessors/0/sparse/indices", says)
        for places, says in (([1, 1], "ascend"), ([4, 2], "ascend"), ([2, 6], "6"))
    ),
    row("glTF 1.0", files.pack(FIRST), UNSUPPORTED, "/asset/version", "version 1.0"),
    row("no version", files.pack({"meshes": {}}), INVALID, "/asset", "version"),
    row("no mesh", files.glb(), UNREFINABLE),
    row("points alone", files.glb([{"POSITION": np.eye(3), "mode": 0}]), UNREFINABLE),
]

WHOLE, HEAD = files.pack(b"{}", b"1234"), struct.Struct("<4sII").pack
CUT = HEAD(b"glTF", 2, 20) + struct.pack("<I4s", 2**32 - 1, b"JSON")
CONTAINERS = [
    row("empty", b"", UNREADABLE),
    row("shorter than its header", WHOLE[:11], UNREADABLE),
    row("another magic", b"gltf" + WHOLE[4:], UNREADABLE),
    row("another version", WHOLE[:4] + struct.pack("<I", 1) + WHOLE[8:], UNREADABLE),
    row("cut short", WHOLE[:-1], UNREADABLE, None, "the file is cut short"),
    row("no chunk", HEAD(b"glTF", 2, 12), UNREADABLE),
    row("half a chunk header", HEAD(b"glTF", 2, 16) + b"1234", UNREADABLE),
    row("a chunk beyond the end", CUT, UNREADABLE),
    row("BIN first", HEAD(b"glTF", 2, 20) + files.chunk(b"BIN\0", b"", b""), UNREADABLE),
    *(
        row(said, start + b" that is no GLB", UNREADABLE, None, f"it begins with {said}")
        for start, said in ((b"a text", "'a text t'"), (b"\n" * 8, "0a 0a"))
    ),
    row(
        "a ZIP", b"PK\x03\x04 is no GLB", UNREADABLE, None, "not a glTF file: it begins with 50 4b"
    ),
    row("chunks", files.pack(b"{}", others=[(b"XTRA", b"")] * 1000), LIMIT, "glb-chunks"),
    *(
        row(f"no JSON: {text}", files.pack(text), UNREADABLE)
        for text in (
            *(b"", b"{", b'{"a":NaN}', b'{"a":Infinity}', b'{"a":1e999}', b"{'a':1}"),
            *(b'{"a":1,}', b'{"a":1} {}', b'{"a":"\xff"}', b'{"a":"\xed\xa0\x80"}'),
            *(b'{"a":"\\ud800"}', b'{"a":01}'),
        )
    ),
    *(row(f"{t}", files.pack(t), INVALID) for t in (b"[]", b"1", b'"glTF"', b"null")),
    *(
        row(
            f"{n} digits",
            files.pack(b'{"a":{"b/c":[1,%s%s]}}' % (sign, b"9" * n)),
            INVALID,
            "/a/b~1c/1",
        )
        for n in (310, 4300, 5000)
        for sign in (b"", b"-")
    ),
]


# Compressed data: what they claim costs nothing.


def stored(edit):
    """A box compressed by Draco, edited."""
    tree, packed = draco()
    primitive = tree["meshes"][0]["primitives"][0]
    edit(tree, primitive, primitive["extensions"][DRACO])
    return files.pack(tree, packed)


def other_width(identity):
    """An edit: an attribute under a number that the data lack, or of another width than asked."""

    def edit(tree, primitive, extension):
        normal = primitive["attributes"].pop("NORMAL")
        tree["accessors"][normal]["type"] = "VEC4"
        primitive["attributes"]["TANGENT"] = normal
        del extension["attributes"]["NORMAL"]
        extension["attributes"]["TANGENT"] = identity

    return edit


def fewer_indices(tree, primitive, extension):
    """A job is measured by what its JSON says, and short ones have a worker to themselves."""
    tree["accessors"][primitive["indices"]]["count"] -= 3


def bytes_for_positions(tree, primitive, extension):
    tree["extensionsUsed"].append("KHR_mesh_quantization")
    tree["accessors"][primitive["attributes"]["POSITION"]]["componentType"] = 5121


def draco_file(data, tree=None):
    """A GLB whose one primitive, an octahedron's if no other, is the given bitstream."""
    tree = tree or files.document([octahedron()])[0]
    extension = {DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    tree["meshes"][0]["primitives"][0]["extensions"] = extension
    for accessor in tree["accessors"]:
        del accessor["bufferView"]
    tree["bufferViews"] = [{"buffer": 0, "byteLength": len(data)}]
    tree["buffers"] = [{"byteLength": len(data)}]
    return files.pack(tree, data)


def header(method, *counts, flags=0):
    head = b"DRACO\2\2\1" + bytes([method]) + flags.to_bytes(2, "little")
    return head + b"".join(counts) + bytes(200)


def without_triangles():
    data = DracoPy.encode(np.eye(3), np.array([[0, 1, 2]], np.uint32), compression_level=0)
    # Sequentially: the count of faces, of points, a method, and three indices of a byte.
    assert (data[11], data[12]) == (1, 3)
    return data[:11] + b"\0" + data[12:13] + data[16:]


def metadata(depth):
    """No entries, then one child without a name, and so on."""
    return b"DRACO\2\2\1\0\0\x80" + b"\0" + b"\0\1\0" * depth + b"\0\0" + b"\1\3"


FOUR_BILLION, MANY = b"\xff\xff\xff\xff\x0f", b"\xff\xff\xff\x07"
CLAIMS = [
    header(0, FOUR_BILLION, FOUR_BILLION),
    header(0, b"\1", FOUR_BILLION),
    header(1, b"\0", FOUR_BILLION, FOUR_BILLION, b"\0", b"\0", b"\0"),
    header(1, b"\0", b"\1", MANY, b"\xff", b"\0", b"\0"),
]
WRONG = [
    b"DRACO",
    b"OCARD" + bytes(100),
    header(2),
    header(0, b"\xff" * 9),
    header(1, b"\0", FOUR_BILLION, b"\1", b"\0", b"\0", b"\0"),
    header(1, b"\0", b"\3", b"\1", b"\0", b"\1", b"\7"),
    header(0, b"\xff\xff\xff\x7f" * 3, flags=0x8000),
    header(0, b"\0\0" + b"\1\1a" * 40, flags=0x8000)[:80],
    header(0, b"\1", b"\3"),
    header(1, b"\0", b"\3", b"\1", b"\0", b"\1", b"\0"),
    # A cloud of points.
    DracoPy.encode(np.random.default_rng(0).random((10, 3))),
]
OLDER = b"DRACO\1\3\1\1\0\0" + bytes(50)
EDITS = [
    (lambda tree, p, e: p.update(mode=6), f"{PRIMITIVE}/mode", "triangles only"),
    (
        lambda tree, p, e: e["attributes"].update(COLOR_0=1),
        f"{DRACO}/attributes",
        "has no accessor",
    ),
    (fewer_indices, "/count", "hold 12 triangles, the indices are those of 11"),
    (lambda tree, p, e: p.pop("indices"), PRIMITIVE, "indices"),
    (lambda tree, p, e: p.update(indices=999), "/indices", "999"),
    (other_width(99), f"{DRACO}/attributes", "no VEC4 under 99"),
    (other_width(1), f"{DRACO}/attributes", "no VEC4 under 1"),
    (bytes_for_positions, "/componentType", "do not fit uint8"),
]


def packed_view(**change):
    """A box compressed by meshopt, of whose first view the extension says something else."""
    tree, packed = compressed_views()
    view = tree["bufferViews"][0]
    said = view["extensions"][MESHOPT]
    said |= change
    if "count" not in change:
        view["byteLength"] = said["byteStride"] * said["count"]
    elif change["count"] != 23:
        view["byteLength"] = said["byteStride"] * change["count"]
    return files.pack(tree, bytes(packed))


MESHOPT_RULES = [
    *(({"byteStride": 10}, ""), ({"byteStride": 260, "count": 1}, ""), ({"count": 23}, "/count")),
    *(({"mode": "TRIANGLES"}, ""), ({"mode": "FACES"}, "/mode"), ({"filter": "OCTAHEDRAL"}, "")),
    *(({"filter": "QUATERNION"}, ""), ({"buffer": 9}, "/buffer"), ({"byteOffset": 10**6}, "")),
    ({"byteLength": 10}, ""),
]


def many_views():
    tree, packed = compressed_views()
    view = tree["bufferViews"][0]
    view["byteLength"] = 12 * 2**20
    view["extensions"][MESHOPT]["count"] = 2**20
    tree["bufferViews"] += [view] * 20
    return files.pack(tree, bytes(packed))


def corners_without_bytes():
    """Four billion points that the file does not hold, each of them a corner."""
    tree, binary = files.document([octahedron()])
    tree["accessors"][0]["count"] = 2**32 - 1
    del tree["accessors"][0]["bufferView"], tree["meshes"][0]["primitives"][0]["indices"]
    return files.pack(tree, bytes(binary))


COMPRESSED = [
    *(row("Draco claims", draco_file(data), LIMIT, "memory") for data in CLAIMS),
    *(row("wrong Draco", draco_file(data), INVALID, f"{EXTENSIONS}/{DRACO}") for data in WRONG),
    row("older Draco", draco_file(OLDER), UNSUPPORTED, None, "Draco bitstream 1.3"),
    row("no triangle", draco_file(without_triangles()), INVALID, DRACO, "hold no triangle"),
    row("deep metadata", draco_file(metadata(17)), INVALID, None, "nest too deep"),
    *(row(says, stored(edit), INVALID, place, says) for edit, place, says in EDITS),
    *(
        row(f"meshopt: {change}", packed_view(**change), INVALID, f"{MESHOPT}{place}")
        for change, place in MESHOPT_RULES
    ),
    row("gigabytes by meshopt", packed_view(count=2**30), LIMIT, "memory"),
    row("many views together", many_views(), LIMIT, "memory"),
    row("an accessor without bytes", corners_without_bytes(), LIMIT, "faces"),
]


@pytest.mark.parametrize(("data", "code", "place", "says"), GEOMETRY + CONTAINERS + COMPRESSED)
def test_what_is_wrong_is_named_where_it_stands_and_costs_nothing(data, code, place, says):
    """Within 16 MiB and five seconds, whatever the file says that it holds."""
    reset_peak()
    before, began = peak_mib(), perf_counter()
    error, used = most_of(refusal, data, limits=Limits(max_memory_bytes=128 * 2**20))
    assert used < 2**22
    assert peak_mib() - before < 16
    assert perf_counter() - began < 5
    assert error.code == code
    assert says in str(error)
    assert place is None or getattr(error, "limit", error.pointer).endswith(place)


def test_a_deep_tree_of_nodes_is_no_cycle():
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"children": [number + 1]} for number in range(20_000)] + [{"mesh": 0}]
    assert refine(files.pack(tree, binary)).report["totals"]["faces"] == 32
    tree["nodes"][-1]["children"] = [0]
    assert "ancestor" in str(refusal(files.pack(tree, binary)))


@pytest.mark.parametrize("step", ["%", "%2B", "%41"])
def test_a_data_uri_of_numbers_takes_what_any_text_does(step):
    tree, _ = files.document([octahedron()])
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{step * 2**20}"
    body = json.dumps(tree).encode()
    error, used = most_of(refusal, body, "gltf")
    assert error.code == INVALID
    assert used < 6 * len(body)
