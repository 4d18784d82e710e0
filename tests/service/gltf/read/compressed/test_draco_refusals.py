"""A promise about Draco data that a file does not keep is told at its place."""

import json

import DracoPy
import numpy as np
import pytest

from service.errors import GltfError, LimitError
from service.gltf.read.compressed import SLACK, decode_primitives, read_header
from service.gltf.read.schema import view
from service.options import Limits
from tests.fuzz.seeds import draco
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files

# Making it asks the decoder which number it gave to what.
STORED = draco()
PRIMITIVE = "/meshes/0/primitives/0"
EXTENSION = f"{PRIMITIVE}/extensions/KHR_draco_mesh_compression"


def refusal(change):
    """Return the refusal of a box with other JSON; `change` gets tree, primitive and extension."""
    tree, packed = draco()
    primitive = tree["meshes"][0]["primitives"][0]
    change(tree, primitive, primitive["extensions"]["KHR_draco_mesh_compression"])
    with pytest.raises(GltfError) as caught:
        refine(files.pack(tree, packed))
    return caught.value


def test_draco_holds_no_fans():
    told = refusal(lambda tree, primitive, extension: primitive.update(mode=6))
    assert (told.pointer, "triangles only" in str(told)) == (f"{PRIMITIVE}/mode", True)


def test_an_attribute_without_an_accessor_is_told():
    told = refusal(lambda tree, primitive, extension: extension["attributes"].update(COLOR_0=1))
    assert (told.pointer, "COLOR_0 has no accessor" in str(told)) == (
        f"{EXTENSION}/attributes",
        True,
    )


def test_more_triangles_than_the_indices_say_are_told():
    """A job is measured by what its JSON says, and short ones have a worker to themselves."""

    def change(tree, primitive, extension):
        tree["accessors"][primitive["indices"]]["count"] -= 3

    told = refusal(change)
    assert told.pointer.endswith("/count")
    assert "hold 12 triangles, the indices are those of 11" in str(told)


@pytest.mark.parametrize("change", [lambda p: p.pop("indices"), lambda p: p.update(indices=999)])
def test_compressed_triangles_without_indices_are_told(change):
    told = refusal(lambda tree, primitive, extension: change(primitive))
    assert "indices" in told.pointer or "need indices" in str(told)


@pytest.mark.parametrize("identity", [99, 1])
def test_an_attribute_that_the_data_lack_is_told(identity):
    def change(tree, primitive, extension):
        normal = primitive["attributes"]["NORMAL"]
        # Neither is another width what was asked for.
        tree["accessors"][normal]["type"] = "VEC4"
        primitive["attributes"]["TANGENT"] = primitive["attributes"].pop("NORMAL")
        del extension["attributes"]["NORMAL"]
        extension["attributes"]["TANGENT"] = identity

    told = refusal(change)
    assert told.pointer == f"{EXTENSION}/attributes"
    assert f"no VEC4 under {identity}" in str(told)


def test_values_that_the_accessors_type_cannot_hold_are_told():
    def change(tree, primitive, extension):
        tree["extensionsUsed"].append("KHR_mesh_quantization")
        accessor = tree["accessors"][primitive["attributes"]["POSITION"]]
        accessor["componentType"] = files.COMPONENTS["u1"]

    told = refusal(change)
    number = draco()[0]["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    assert told.pointer == f"/accessors/{number}/componentType"
    assert "do not fit uint8" in str(told)


def test_points_alone_hold_no_triangle():
    points = np.random.default_rng(0).random((10, 3))
    cloud = DracoPy.encode(points)
    with pytest.raises(GltfError, match="no Draco mesh"):
        read_header(cloud, "")


def test_data_without_a_triangle_are_told():
    data = DracoPy.encode(np.eye(3), np.array([[0, 1, 2]], np.uint32), compression_level=0)
    # Sequentially: the count of faces, of points, a method, and three indices of a byte.
    assert (data[11], data[12]) == (1, 3)
    empty = data[:11] + b"\0" + data[12:13] + data[16:]
    tree, _ = draco()
    tree["meshes"], tree["nodes"] = tree["meshes"][:1], tree["nodes"][:1]
    tree["scenes"] = [{"nodes": [0]}]
    tree["bufferViews"] = [{"buffer": 0, "byteLength": len(empty)}]
    tree["buffers"] = [{"byteLength": len(empty)}]
    with pytest.raises(GltfError, match="hold no triangle") as caught:
        refine(files.pack(tree, empty))
    assert caught.value.pointer == EXTENSION


def test_a_decoder_that_takes_more_than_was_counted_meets_a_limit(monkeypatch):
    def takes_more(data):
        raise MemoryError

    monkeypatch.setattr(DracoPy, "decode", takes_more)
    tree, packed = STORED
    with pytest.raises(LimitError, match="header accounts for") as caught:
        refine(files.pack(tree, packed))
    assert caught.value.limit == "memory"
    # Of a box, hardly more than what the allocator may reserve.
    assert SLACK < caught.value.allowed < SLACK + 2**20


def test_what_was_decoded_is_counted_once_and_not_for_each_primitive():
    """A scene of 8,000 primitives took four times as long to read."""

    class Counted(list):
        counts = 0

        def __iter__(self):
            Counted.counts += 1
            return super().__iter__()

    tree, packed = draco()
    primitive = json.dumps(tree["meshes"][0]["primitives"][0])
    tree["meshes"][0]["primitives"] = [json.loads(primitive) for _ in range(20)]
    stored, content = files.unpack(files.pack(tree, packed))
    buffers = Counted([memoryview(content)])
    views = decode_primitives(stored, view(stored), buffers, len(content), Limits())
    assert len(views) > 20
    assert Counted.counts == 1


def test_metadata_nest_so_deep_and_no_deeper():
    def nested(depth):
        # No entries, then one child without a name, and so on.
        return b"DRACO\2\2\1\0\0\x80" + b"\0" + b"\0\1\0" * depth + b"\0\0" + b"\1\3"

    assert read_header(nested(16), "").faces == 1
    with pytest.raises(GltfError, match="nest too deep"):
        read_header(nested(17), "")
