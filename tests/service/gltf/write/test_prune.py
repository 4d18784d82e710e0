"""Data that refinement has replaced leave the file; the others stay, byte for byte."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.gltf.write.prune import cut, moved
from tests.service.gltf.subdivided import subdivide
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron


def refine(tree, binary):
    return subdivide(data=files.pack(tree, binary), normals="keep")


def mixed():
    """Triangles, points that share their positions, an image, an animation, unused data."""
    tree, binary = files.document([box()], [octahedron()])
    shared = tree["meshes"][1]["primitives"][0]["attributes"]["POSITION"]
    tree["meshes"].append({"primitives": [{"attributes": {"POSITION": shared}, "mode": 0}]})
    rng = np.random.default_rng(0)
    times = files.add_accessor(tree, binary, np.arange(4.0).reshape(-1, 1))
    moves = files.add_accessor(tree, binary, rng.random((4, 3)))
    files.add_accessor(tree, binary, rng.random((5, 2)))
    tree["animations"] = [
        {
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
            "samplers": [{"input": times, "output": moves}],
        }
    ]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": 13})
    binary.extend(rng.bytes(16))
    tree["images"] = [{"bufferView": len(tree["bufferViews"]) - 1, "mimeType": "image/png"}]
    tree["buffers"][0]["byteLength"] = len(binary)
    return tree, binary


def test_replaced_geometry_leaves_and_the_rest_keeps_its_number_and_bytes():
    tree, binary = mixed()
    after, content = files.unpack(refine(tree, binary).glb)
    assert len(after["accessors"]) == 11
    for key in ("images", "animations", "skins", "nodes"):
        assert after.get(key) == tree.get(key)
    kept = [5, 7, 8, 9]
    for index in kept:
        np.testing.assert_array_equal(
            files.values_of(after, content, index), files.values_of(tree, bytes(binary), index)
        )
        assert {**after["accessors"][index], "bufferView": 0} == {
            **tree["accessors"][index],
            "bufferView": 0,
        }
    old, new = (t["bufferViews"][t["images"][0]["bufferView"]] for t in (tree, after))
    assert content[new["byteOffset"] :][:13] == binary[old["byteOffset"] :][:13]
    assert sum(view["byteLength"] for view in after["bufferViews"]) >= len(content) - 16


def test_an_unknown_extension_keeps_everything_declared_or_not():
    tree, binary = mixed()
    tree["extensionsUsed"] = ["ACME_gadget"]
    tree["nodes"][0]["extensions"] = {"ACME_gadget": {"accessor": 0}}
    result = refine(tree, binary)
    after, content = files.unpack(result.glb)
    assert content[: len(binary)] == binary
    assert after["accessors"][: len(tree["accessors"])] == tree["accessors"]
    told = "replaced geometry kept: ACME_gadget may refer to it"
    assert [change["what"] for change in result.report["changes"]] == [told]
    tree, binary = mixed()
    tree["meshes"][0]["primitives"][0]["extensions"] = {"ACME_gadget": {"view": 3}}
    assert files.unpack(refine(tree, binary).glb)[1][: len(binary)] == binary


def test_instances_keep_their_accessors():
    tree, binary = mixed()
    where = files.add_accessor(tree, binary, np.random.default_rng(1).random((3, 3)))
    tree["buffers"][0]["byteLength"] = len(binary)
    name = "EXT_mesh_gpu_instancing"
    tree["extensionsUsed"] = [name]
    tree["nodes"][0]["extensions"] = {name: {"attributes": {"TRANSLATION": where}}}
    after, content = files.unpack(refine(tree, binary).glb)
    index = after["nodes"][0]["extensions"][name]["attributes"]["TRANSLATION"]
    np.testing.assert_array_equal(
        files.values_of(after, content, index), files.values_of(tree, bytes(binary), where)
    )


RANGES = st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), max_size=5).map(
    lambda pairs: [(start, start + length) for start, length in pairs]
)


@given(RANGES, RANGES, st.lists(st.integers(0, 40), min_size=1, max_size=5))
def test_cuts_take_only_what_nothing_needs(gone, needed, lengths):
    whole = bytes(range(sum(lengths)))
    gone, needed = (
        [(min(a, len(whole)), min(b, len(whole))) for a, b in ranges] for ranges in (gone, needed)
    )
    ends = np.cumsum([0, *lengths])
    pieces = [whole[a:b] for a, b in pairwise(ends)]
    left, shifts = cut(pieces, *(np.array(each, int).reshape(-1, 2) for each in (gone, needed)))
    data = b"".join(bytes(piece) for piece in left)
    spared = {i for a, b in gone for i in range(a, b)} - {i for a, b in needed for i in range(a, b)}
    assert set(whole) - set(data) <= spared
    for byte, place in zip(data, moved(list(data), shifts), strict=True):
        assert data[place] == byte
        assert (place - byte) % 4 == 0
    # Words that nothing needs do go.
    words = [i for i in range(0, len(whole) - 3, 4) if {i, i + 1, i + 2, i + 3} <= spared]
    assert not set(words) & set(data)
