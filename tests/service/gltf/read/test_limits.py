"""The cost of a file is known before it is paid; float32 and buffers end somewhere."""

import base64
import json
import re
from urllib.parse import quote

import DracoPy
import meshopt
import numpy as np
import pytest

from benchmarks.memory import peak_mib, reset_peak
from service.errors import LimitError, NoModelError, ServiceError, UnrefinableError
from service.gltf.read.compressed import SLACK, read_header
from service.gltf.subdivide import subdivide_gltf
from service.memory_cap import memory_cap
from service.options import Limits, Options
from tests.fuzz.seeds import draco
from tests.service.gltf.read.refused import refine, refusal
from tests.service.gltf.read.test_refusals import draco_file, metadata
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.memory import most_of
from tests.support.meshes import bumpy_sphere
from tests.support.networks import random_model

# Faces and memory


def test_predicted_faces_are_checked_at_the_limit():
    data = files.glb([octahedron()], [octahedron(), octahedron()])
    made = refine(data, levels=2, limits=Limits(max_faces=3 * 8 * 16))
    assert made.report["totals"]["faces"] == 384
    error = refusal(data, levels=2, limits=Limits(max_faces=383))
    assert (error.limit, error.found, error.status) == ("faces", 384, 413)


def grid(count, *, smooth, skinned):
    """Noise over a grid; smooth shares every vertex, the other has one for each corner."""
    x, y = np.meshgrid(np.arange(count + 1.0), np.arange(count + 1), indexing="ij")
    rng = np.random.default_rng(0)
    points = np.stack([x.reshape(-1), y.reshape(-1), rng.random(x.size)], axis=1)
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1, 1)
    sides = [0, count + 1, 1], [1, count + 1, count + 2]
    faces = np.concatenate([np.add(corner, side) for side in sides])
    if not smooth:
        points, faces = points[faces.reshape(-1)], np.arange(faces.size).reshape(-1, 3)
    shape = {"POSITION": points, "NORMAL": rng.standard_normal((len(points), 3))}
    shape |= {"TEXCOORD_0": points[:, :2], "indices": faces}
    if skinned:
        shape["JOINTS_0"] = rng.integers(0, 20, (len(points), 4)).astype(np.uint8)
        shape["WEIGHTS_0"] = np.full((len(points), 4), 0.25, dtype=np.float32)
    return files.glb([shape])


def with_image(size):
    """Eight faces, and an image that is copied through."""
    tree, binary = files.document([octahedron()])
    start = len(binary) + -len(binary) % 4
    tree["buffers"][0]["byteLength"] = start + size
    tree["images"] = [{"bufferView": len(tree["bufferViews"]), "mimeType": "image/png"}]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": size})
    return files.pack(tree, bytes(binary).ljust(start + size, b"\0"))


def wide(place, letter):
    """A letter that makes all of its string wide."""
    tree, binary = files.document([octahedron()])
    tree["buffers"][0]["uri"] = f"data:;base64,{base64.b64encode(binary).decode()}"
    tree["images"] = [{place: "@"}]
    return json.dumps(tree).encode().replace(b"@", b"a" * 2**21 + letter.encode())


def narrow():
    """Attributes of a byte, which are written as wide as any."""
    vertices, faces = bumpy_sphere(subdivisions=2)
    corners = vertices[faces].reshape(-1, 3)
    bytes_ = {f"_A{n}": np.ones((len(corners), 1), np.uint8) for n in range(100)}
    return files.glb([{"POSITION": corners, **bytes_}])


def moved(whose):
    """Targets without positions, and what one primitive has and others have not, are zeros."""
    vertices, faces = bumpy_sphere(subdivisions=2)
    large = {"POSITION": vertices, "indices": faces}
    small = octahedron(POSITION=4 + octahedron()["POSITION"])
    if whose == "its own":
        large["targets"] = [{}] * 200
    elif whose == "another's":
        small["targets"] = [{"POSITION": small["POSITION"]}] * 200
    else:
        joints, weights = np.zeros((6, 4), np.uint8), np.tile(np.float32([1, 0, 0, 0]), (6, 1))
        small |= {f"JOINTS_{n}": joints for n in range(30)}
        small |= {f"WEIGHTS_{n}": weights for n in range(30)}
    tree, binary = files.document([large, small])
    tree["nodes"], tree["skins"] = [{"mesh": 0, "skin": 0}, {}], [{"joints": [1]}]
    return files.pack(tree, binary)


def shared(what, whose):
    """What a shared accessor says is written as often as it is shared."""
    tree, binary = files.document([octahedron()])
    tree["accessors"][0][what] = "a" * 2**17
    (mesh,) = tree["meshes"]
    if whose == "primitives":
        mesh["primitives"] *= 100
    else:
        mesh["primitives"][0]["targets"] = [{"POSITION": 0}] * 100
    return files.pack(tree, binary)


def creased():
    vertices, faces = bumpy_sphere(subdivisions=3)
    return files.glb([{"POSITION": vertices, "indices": faces}])


COSTS = [
    *(
        pytest.param(
            grid(64 // 2 ** (levels - 1), smooth=smooth, skinned=skinned),
            {"levels": levels, "diagnostics": "full"},
            id=f"level {levels}, smooth {smooth}, skinned {skinned}",
        )
        for levels in (1, 3)
        for smooth in (True, False)
        for skinned in (True, False)
    ),
    pytest.param(with_image(16 * 2**20), {}, id="an image"),
    pytest.param(creased(), {"crease": "angle:0", "levels": 2}, id="every edge a crease"),
    pytest.param(narrow(), {}, id="narrow attributes"),
    *(
        pytest.param(wide(place, letter), {"media": "gltf"}, id=f"{letter!a} in a {place}")
        for letter in ("\u00e9", "\u20ac", "\U0001f600", r"\ud83d\ude00")
        for place in ("name", "uri")
    ),
    *(
        pytest.param(moved(whose), {"levels": 2}, id=f"moved by {whose}")
        for whose in ("its own", "another's", "another's joints")
    ),
    *(
        pytest.param(shared(what, whose), {}, id=f"{what} of {whose}")
        for what in ("name", "extras")
        for whose in ("primitives", "targets")
    ),
]


@pytest.mark.parametrize(("data", "options"), COSTS)
def test_predicted_memory_bounds_what_is_used(data, options):
    # Kernels are loaded with the first that needs them.
    refine(data, **options)
    _, used = most_of(refine, data, **options)
    # The upload itself was there before.
    image = len(data) if len(data) > 2**24 else 0
    error = refusal(data, **options, limits=Limits(max_memory_bytes=used + image - 1))
    assert error.limit == "memory"
    assert "diagnostics" not in options or error.found < 5 * used


def test_many_primitives_over_one_large_accessor_count_as_they_cost():
    # 400 triangles that share 60,000 vertices: work in proportion to the triangles.
    points = np.random.default_rng(0).standard_normal((60_000, 3))
    tree, binary = files.document([{"POSITION": points, "indices": np.array([[0, 1, 2]])}])
    tree["meshes"][0]["primitives"] *= 400
    report = refine(files.pack(tree, binary), limits=Limits(max_memory_bytes=64 * 2**20)).report
    assert report["totals"]["faces"] == 1600


def test_nodes_are_predicted_before_they_are_made():
    # 3.4 MB of empty nodes take 257 MB.
    tree, binary = files.document([octahedron()])
    text = json.dumps(tree).replace('"nodes": [', '"nodes": [' + "{}," * 900_000)
    limits = Limits(max_memory_bytes=100 * 2**20, max_json_items=10**7)
    assert refusal(files.pack(text.encode(), binary), limits=limits).limit == "memory"


def test_a_sparse_accessor_without_bytes_costs_what_is_used_of_it():
    # Four billion positions, of which the file gives two and the faces use three.
    tree, binary = files.document([octahedron()])
    rows = files.add_accessor(tree, binary, np.array([[1], [2]], dtype=np.uint32))
    values = files.add_accessor(tree, binary, np.eye(3)[:2])
    faces = files.add_accessor(tree, binary, np.array([[0], [1], [2]], dtype=np.uint32))
    views = [tree["accessors"][index]["bufferView"] for index in (rows, values)]
    position = tree["accessors"][0]
    del position["bufferView"]
    places = {"bufferView": views[0], "componentType": 5125}
    stored = {"count": 2, "indices": places, "values": {"bufferView": views[1]}}
    position |= {"count": 2**32 - 1, "sparse": stored}
    tree["buffers"] = [{"byteLength": len(binary)}]
    tree["meshes"][0]["primitives"][0]["indices"] = faces
    result, used = most_of(refine, files.pack(tree, bytes(binary)))
    assert used < 2**22
    assert result.report["totals"]["faces"] == 4


# Compressed data


def test_the_header_of_draco_data_says_what_the_decoder_finds():
    tree, packed = draco()
    for view in tree["bufferViews"]:
        header = read_header(bytes(packed[view["byteOffset"] :][: view["byteLength"]]), "")
        assert header.faces == 12
        assert header.points >= 24
    assert read_header(metadata(16), "").faces == 1


def test_attributes_that_a_header_does_not_announce_are_capped():
    # A hundred attributes of 255 doubles at each of 100,000 points: 20 GB, in two kilobytes.
    faces, points = b"\x64", b"\xa0\x8d\x06"
    indices = b"\1" + b"\0\0\0" * 100
    attribute = b"\4\x0b\xff\0"
    decoders = b"\1" + b"\x64" + b"".join(attribute + bytes([n]) for n in range(100)) + b"\0" * 100
    data = b"DRACO\2\2\1\0\0\0" + faces + points + indices + decoders + bytes(1000)
    reset_peak()
    before = peak_mib()
    error = refusal(draco_file(data), limits=Limits(max_memory_bytes=64 * 2**20))
    assert 400 <= error.status < 500
    assert peak_mib() - before < 64 + 64


def test_a_decoder_that_takes_more_than_was_counted_meets_a_limit(monkeypatch):
    with pytest.raises(LimitError, match="so much"), memory_cap(2**26, "so much"):
        np.ones(2**27)
    assert np.ones(2**24).sum() == 2**24
    data = files.pack(*draco())

    def takes_more(data):
        raise MemoryError

    monkeypatch.setattr(DracoPy, "decode", takes_more)
    error = refusal(data)
    assert "header accounts for" in str(error)
    # Of a box, hardly more than what the allocator may reserve.
    assert SLACK < error.allowed < SLACK + 2**20


def test_draco_takes_normalised_integers():
    # The decoder hands them back as floats that are whole.
    shape = octahedron()
    whole = np.rint(shape["POSITION"] / np.abs(shape["POSITION"]).max() * 32767).astype(np.int16)
    plain = shape | {"POSITION": files.Normalized(whole)}
    data = DracoPy.encode(
        whole.astype(np.float64),
        shape["indices"].astype(np.uint32),
        quantization_bits=16,
        quantization_range=65535,
        quantization_origin=[-32768.0] * 3,
        preserve_order=True,
    )
    tree, _ = files.document([plain])
    tree["extensionsUsed"] = ["KHR_draco_mesh_compression", "KHR_mesh_quantization"]
    expected, refined = refine(files.glb([plain])), refine(draco_file(data, tree))
    assert refined.report["levels"] == expected.report["levels"]
    assert refined.report["meshes"] == expected.report["meshes"]


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("filter_name", ["NONE", "EXPONENTIAL"])
def test_both_names_and_filters_of_meshopt_decode(name, filter_name):
    shape = octahedron()
    tree, _ = files.document([shape])
    points = shape["POSITION"].astype(np.float32)
    rows = points if filter_name == "NONE" else meshopt.encode_filter_exp(points, 20)
    # The second version of the codec exists under KHR's name alone.
    data = meshopt.encode_vertex_buffer_level(rows, 2, 1 if name.startswith("KHR") else 0)
    start = -len(data) % 4 + len(data)
    indices = shape["indices"].astype(np.uint32).tobytes()
    said = {"buffer": 0, "byteLength": len(data), "byteStride": 12, "count": 6}
    said |= {"mode": "ATTRIBUTES", "filter": filter_name}
    tree["buffers"] = [{"byteLength": start + len(indices)}, {"byteLength": 72}]
    tree["bufferViews"] = [
        {"buffer": 1, "byteLength": 72, "extensions": {name: said}},
        {"buffer": 0, "byteOffset": start, "byteLength": len(indices)},
    ]
    tree["extensionsUsed"] = tree["extensionsRequired"] = [name]
    result = refine(files.pack(tree, data + bytes(start - len(data)) + indices))
    assert "extensionsUsed" not in files.unpack(result.glb)[0]
    _, decoded = files.primitive_of(result.glb)
    _, wanted = files.primitive_of(refine(files.glb([shape])).glb)
    np.testing.assert_allclose(decoded["POSITION"], wanted["POSITION"], atol=1e-5)


# Numbers that end somewhere


@pytest.mark.parametrize(
    ("size", "budget", "levels", "scale"),
    [(3.4e38, None, 2, 1.0), (3e38, 1e4, 2, 1.0), (1.0, 1e30, 3, 30.0)],
    ids=["up to float32's end", "beyond float32", "an edge of 10³⁰ moves its vertex by 10⁶⁰"],
)
def test_positions_are_refined_up_to_the_end_of_float32(size, budget, levels, scale):
    data = files.glb([octahedron(POSITION=size * octahedron()["POSITION"])])
    if budget is None:
        assert refine(data, levels=levels).report["totals"]["faces"] == 128
        return
    options, model = Options(budget=budget, levels=levels), random_model(0, scale=scale)
    with pytest.raises(UnrefinableError) as refused:
        subdivide_gltf(data, "glb", options, model, Limits())
    assert refused.value.pointer == "/meshes/0"


def test_the_learned_scheme_needs_a_model():
    assert isinstance(refusal(files.glb([octahedron()]), scheme="pns"), NoModelError)
    assert issubclass(NoModelError, ServiceError)


# Buffers in the JSON


def test_buffers_in_data_uris_are_read_and_joined():
    tree, binary = files.document([box()], [octahedron()])
    cut = tree["bufferViews"][5]["byteOffset"]
    parts = [bytes(binary[:cut]), bytes(binary[cut:])]
    for view in tree["bufferViews"][5:]:
        view["buffer"], view["byteOffset"] = 1, view["byteOffset"] - cut
    start = "data:application/gltf-buffer;base64,"
    tree["buffers"] = [
        {"byteLength": len(part), "uri": start + base64.b64encode(part).decode()} for part in parts
    ]
    result = refine(json.dumps(tree).encode(), "gltf")
    whole = refine(files.glb([box()], [octahedron()]))
    for mesh in (0, 1):
        (faces, attributes), (wanted_faces, wanted) = (
            files.primitive_of(made.glb, mesh) for made in (result, whole)
        )
        np.testing.assert_array_equal(faces, wanted_faces)
        for name, values in wanted.items():
            np.testing.assert_array_equal(attributes[name], values)
    (buffer,) = files.unpack(result.glb)[0]["buffers"]
    assert "uri" not in buffer
    joined = {
        "pointer": "/buffers",
        "code": "buffers-joined",
        "what": "joined into one",
        "count": 2,
    }
    assert result.report["changes"] == [joined]


@pytest.mark.parametrize("case", [str, str.lower])
def test_a_data_uri_may_spell_its_letters_by_numbers(case):
    tree, binary = files.document([octahedron()])
    # What lies behind the buffer's length is not read.
    behind = b"\xfb\xef\xbe\xff" * 6
    spelt = quote(base64.b64encode(binary + behind[: 22 - len(binary) % 3]), safe="")
    assert {"%2B", "%2F", "%3D"} <= set(re.findall("%..", spelt))
    spelt = re.sub("%..", lambda found: case(found[0]), spelt)
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{spelt}"
    result = refine(json.dumps(tree).encode(), "gltf")
    assert result.glb == refine(files.glb([octahedron()])).glb
