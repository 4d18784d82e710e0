"""A file's claims cost nothing: compressed and sparse data are refused before they allocate."""

import json
import tracemalloc
from time import perf_counter

import DracoPy
import meshopt
import numpy as np
import pytest

from benchmarks.memory import peak_mib, reset_peak
from service.errors import GltfError, LimitError, ServiceError, UnsupportedFeature
from service.gltf.read.compressed import read_header
from service.memory_cap import memory_cap
from service.options import Limits
from tests.fuzz.seeds import compressed_views, draco
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron

FOUR_BILLION = b"\xff\xff\xff\xff\x0f"
MESHOPT = "EXT_meshopt_compression"


def costs_nothing(data, error, limits=None):
    """The refusal of a file, which takes less than 4 MiB."""
    tracemalloc.start()
    reset_peak()
    before, began = peak_mib(), perf_counter()
    try:
        with pytest.raises(error) as refusal:
            refine(data, limits=limits)
        assert tracemalloc.get_traced_memory()[1] < 2**22
    finally:
        tracemalloc.stop()
    assert peak_mib() - before < 16
    assert perf_counter() - began < 5
    return refusal.value


def draco_file(data, tree=None):
    """A GLB whose one primitive, an octahedron's if no other, is the given bitstream."""
    tree = tree or files.document([octahedron()])[0]
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}
    }
    for accessor in tree["accessors"]:
        del accessor["bufferView"]
    tree["bufferViews"] = [{"buffer": 0, "byteLength": len(data)}]
    tree["buffers"] = [{"byteLength": len(data)}]
    return files.pack(tree, data)


def test_draco_takes_normalised_integers():
    # The decoder hands them back as floats that are whole.
    shape = octahedron()
    whole = np.rint(shape["POSITION"] / np.abs(shape["POSITION"]).max() * 32767).astype(np.int16)
    plain = shape | {"POSITION": files.Normalized(whole)}
    data = DracoPy.encode(
        whole.astype(np.float64),
        np.asarray(shape["indices"]).reshape(-1, 3).astype(np.uint32),
        quantization_bits=16,
        quantization_range=65535,
        quantization_origin=[-32768.0] * 3,
        preserve_order=True,
    )
    tree, _ = files.document([plain])
    primitive = tree["meshes"][0]["primitives"][0]
    accessor = tree["accessors"][primitive["attributes"]["POSITION"]]
    assert (accessor["componentType"], accessor["normalized"]) == (5122, True)
    primitive["attributes"] = {"POSITION": primitive["attributes"]["POSITION"]}
    tree["extensionsUsed"] = ["KHR_draco_mesh_compression", "KHR_mesh_quantization"]
    expected = refine(files.pack(*files.document([plain])), limits=Limits())
    refined = refine(draco_file(data, tree), limits=Limits())
    assert refined.report["levels"] == expected.report["levels"]
    assert refined.report["meshes"] == expected.report["meshes"]


def test_nodes_are_predicted_before_they_are_made():
    # 3.4 MB of empty nodes take 257 MB.
    tree, binary = files.document([octahedron()])
    text = json.dumps(tree).replace('"nodes": [', '"nodes": [' + "{}," * 900_000)
    limits = Limits(max_memory_bytes=100 * 2**20, max_json_items=10**7)
    with pytest.raises(LimitError) as refusal:
        refine(files.pack(text.encode(), binary), limits=limits)
    assert refusal.value.limit == "memory"


def header(method, *counts, flags=0):
    head = b"DRACO\2\2\1" + bytes([method]) + flags.to_bytes(2, "little")
    return head + b"".join(counts) + bytes(200)


@pytest.mark.parametrize(
    "data",
    [
        header(0, FOUR_BILLION, FOUR_BILLION),
        header(0, b"\1", FOUR_BILLION),
        header(1, b"\0", FOUR_BILLION, FOUR_BILLION, b"\0", b"\0", b"\0"),
        header(1, b"\0", b"\1", b"\xff\xff\xff\x07", b"\xff", b"\0", b"\0"),
    ],
)
def test_a_draco_header_that_claims_billions_costs_nothing(data):
    refusal = costs_nothing(draco_file(data), LimitError)
    assert (refusal.limit, refusal.status) == ("memory", 413)
    assert refusal.found > 10**9


@pytest.mark.parametrize(
    "data",
    [
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
    ],
)
def test_draco_data_that_cannot_be_right_are_refused_with_their_pointer(data):
    refusal = costs_nothing(draco_file(data), GltfError)
    assert refusal.pointer == "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression"


def test_other_draco_bitstreams_are_refused_by_name():
    with pytest.raises(UnsupportedFeature, match=r"Draco bitstream 1\.3"):
        refine(draco_file(b"DRACO\1\3\1\1\0\0" + bytes(50)))


def test_the_header_says_what_the_decoder_finds():
    tree, packed = draco()
    for view in tree["bufferViews"]:
        data = bytes(packed[view["byteOffset"] :][: view["byteLength"]])
        header = read_header(data, "")
        assert header.faces == 12
        assert header.points >= 24


def test_attributes_that_a_header_does_not_announce_are_capped():
    # A hundred attributes of 255 doubles at each of 100,000 points: 20 GB, in two kilobytes.
    faces, points = b"\x64", b"\xa0\x8d\x06"
    indices = b"\1" + b"\0\0\0" * 100
    attribute = b"\4\x0b\xff\0"
    decoders = b"\1" + b"\x64" + b"".join(attribute + bytes([n]) for n in range(100)) + b"\0" * 100
    data = b"DRACO\2\2\1\0\0\0" + faces + points + indices + decoders + bytes(1000)
    reset_peak()
    before = peak_mib()
    limits = Limits(max_memory_bytes=64 * 2**20)
    with pytest.raises(ServiceError) as refusal:
        refine(draco_file(data), limits=limits)
    assert 400 <= refusal.value.status < 500
    assert peak_mib() - before < 64 + 64


def test_code_under_a_cap_gets_no_more_memory():
    with pytest.raises(LimitError, match="so much"), memory_cap(2**26, "so much"):
        np.ones(2**27)
    assert np.ones(2**24).sum() == 2**24


def test_a_meshopt_view_that_claims_gigabytes_costs_nothing():
    tree, packed = compressed_views()
    view = tree["bufferViews"][0]
    count = 2**30
    view["byteLength"] = 12 * count
    view["extensions"][MESHOPT]["count"] = count
    refusal = costs_nothing(files.pack(tree, bytes(packed)), LimitError)
    assert (refusal.limit, refusal.found > 12 * count) == ("memory", True)


def test_many_meshopt_views_count_together():
    tree, packed = compressed_views()
    view = tree["bufferViews"][0]
    view["byteLength"] = 12 * 2**20
    view["extensions"][MESHOPT]["count"] = 2**20
    tree["bufferViews"] += [view] * 20
    limits = Limits(max_memory_bytes=128 * 2**20)
    assert costs_nothing(files.pack(tree, bytes(packed)), LimitError, limits).limit == "memory"


MESHOPT_RULES = [
    ({"byteStride": 10}, ""),
    ({"byteStride": 260, "count": 1}, ""),
    ({"count": 23}, "/count"),
    ({"mode": "TRIANGLES"}, ""),
    ({"mode": "FACES"}, "/mode"),
    ({"filter": "OCTAHEDRAL"}, ""),
    ({"filter": "QUATERNION"}, ""),
    ({"buffer": 9}, "/buffer"),
    ({"byteOffset": 10**6}, ""),
    ({"byteLength": 10}, ""),
]


@pytest.mark.parametrize(("change", "pointer"), MESHOPT_RULES)
def test_meshopt_views_that_break_their_rules_are_refused(change, pointer):
    tree, packed = compressed_views()
    view = tree["bufferViews"][0]
    view["extensions"][MESHOPT] |= change
    if "count" not in change:
        view["byteLength"] = (
            view["extensions"][MESHOPT]["byteStride"] * view["extensions"][MESHOPT]["count"]
        )
    elif change["count"] == 1:
        view["byteLength"] = 260
    refusal = costs_nothing(files.pack(tree, bytes(packed)), GltfError)
    assert refusal.pointer == f"/bufferViews/0/extensions/{MESHOPT}{pointer}"


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("filter_name", ["NONE", "EXPONENTIAL"])
def test_both_names_and_filters_decode(name, filter_name):
    shape = octahedron()
    tree, _ = files.document([shape])
    points = shape["POSITION"].astype(np.float32)
    rows = points if filter_name == "NONE" else meshopt.encode_filter_exp(points, 20)
    # The second version of the codec exists under KHR's name alone.
    data = meshopt.encode_vertex_buffer_level(rows, 2, 1 if name.startswith("KHR") else 0)
    start = -len(data) % 4 + len(data)
    indices = shape["indices"].astype(np.uint32).tobytes()
    tree["buffers"] = [{"byteLength": start + len(indices)}, {"byteLength": 72}]
    tree["bufferViews"] = [
        {
            "buffer": 1,
            "byteLength": 72,
            "extensions": {
                name: {
                    "buffer": 0,
                    "byteLength": len(data),
                    "byteStride": 12,
                    "count": 6,
                    "mode": "ATTRIBUTES",
                    "filter": filter_name,
                }
            },
        },
        {"buffer": 0, "byteOffset": start, "byteLength": len(indices)},
    ]
    tree["extensionsUsed"] = tree["extensionsRequired"] = [name]
    result = refine(files.pack(tree, data + bytes(start - len(data)) + indices))
    after, _ = files.unpack(result.glb)
    assert "extensionsUsed" not in after
    _, decoded = files.primitive_of(result.glb)
    _, wanted = files.primitive_of(refine(files.glb([shape])).glb)
    np.testing.assert_allclose(decoded["POSITION"], wanted["POSITION"], atol=1e-5)


def test_a_sparse_accessor_without_bytes_costs_what_is_used_of_it():
    # Four billion positions, of which the file gives two and the faces use three.
    tree, binary = files.document([octahedron()])
    rows = files.add_accessor(tree, binary, np.array([[1], [2]], dtype=np.uint32))
    values = files.add_accessor(tree, binary, np.eye(3)[:2])
    faces = files.add_accessor(tree, binary, np.array([[0], [1], [2]], dtype=np.uint32))
    views = [tree["accessors"][index]["bufferView"] for index in (rows, values)]
    position = tree["accessors"][0]
    del position["bufferView"]
    position |= {
        "count": 2**32 - 1,
        "sparse": {
            "count": 2,
            "indices": {"bufferView": views[0], "componentType": 5125},
            "values": {"bufferView": views[1]},
        },
    }
    tree["buffers"] = [{"byteLength": len(binary)}]
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["indices"] = faces
    tracemalloc.start()
    try:
        result = refine(files.pack(tree, bytes(binary)))
        assert tracemalloc.get_traced_memory()[1] < 2**22
    finally:
        tracemalloc.stop()
    assert result.report["totals"]["faces"] == 4
    # Without indices, all four billion are corners.
    del primitive["indices"]
    assert costs_nothing(files.pack(tree, bytes(binary)), LimitError).limit == "faces"
