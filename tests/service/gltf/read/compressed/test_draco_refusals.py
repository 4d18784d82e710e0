"""A promise about Draco data that a file does not keep is told at its place."""

import DracoPy
import numpy as np
import pytest

from service.errors import GltfError, LimitError
from service.gltf.read.compressed import SLACK, read_header
from tests.fuzz.seeds import draco
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files

# Making it asks the decoder which number it gave to what.
STORED = draco()
PRIMITIVE = "/meshes/0/primitives/0"
EXTENSION = f"{PRIMITIVE}/extensions/KHR_draco_mesh_compression"


def fewer_indices(tree, primitive, extension):
    """A job is measured by what its JSON says, and short ones have a worker to themselves."""
    tree["accessors"][primitive["indices"]]["count"] -= 3


def other_width(identity):
    """An edit: an attribute under a number that the data lack, or of another width than asked."""

    def edit(tree, primitive, extension):
        normal = primitive["attributes"].pop("NORMAL")
        tree["accessors"][normal]["type"] = "VEC4"
        primitive["attributes"]["TANGENT"] = normal
        del extension["attributes"]["NORMAL"]
        extension["attributes"]["TANGENT"] = identity

    return edit


def bytes_for_positions(tree, primitive, extension):
    tree["extensionsUsed"].append("KHR_mesh_quantization")
    tree["accessors"][primitive["attributes"]["POSITION"]]["componentType"] = files.COMPONENTS["u1"]


REFUSED = {
    "a fan": (lambda tree, p, e: p.update(mode=6), f"{PRIMITIVE}/mode", "triangles only"),
    "no accessor": (
        lambda tree, p, e: e["attributes"].update(COLOR_0=1),
        f"{EXTENSION}/attributes",
        "COLOR_0 has no accessor",
    ),
    "fewer indices": (fewer_indices, "/count", "hold 12 triangles, the indices are those of 11"),
    "no indices": (lambda tree, p, e: p.pop("indices"), PRIMITIVE, "indices"),
    "other indices": (lambda tree, p, e: p.update(indices=999), "/indices", "999"),
    "another number": (other_width(99), f"{EXTENSION}/attributes", "no VEC4 under 99"),
    "another width": (other_width(1), f"{EXTENSION}/attributes", "no VEC4 under 1"),
    "a narrow type": (bytes_for_positions, "/componentType", "do not fit uint8"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_broken_promise_is_refused_where_it_stands(name):
    edit, place, says = REFUSED[name]
    tree, packed = draco()
    primitive = tree["meshes"][0]["primitives"][0]
    edit(tree, primitive, primitive["extensions"]["KHR_draco_mesh_compression"])
    with pytest.raises(GltfError, match=says) as caught:
        refine(files.pack(tree, packed))
    assert place in caught.value.pointer


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


def test_metadata_nest_so_deep_and_no_deeper():
    def nested(depth):
        # No entries, then one child without a name, and so on.
        return b"DRACO\2\2\1\0\0\x80" + b"\0" + b"\0\1\0" * depth + b"\0\0" + b"\1\3"

    assert read_header(nested(16), "").faces == 1
    with pytest.raises(GltfError, match="nest too deep"):
        read_header(nested(17), "")
