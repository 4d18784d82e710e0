"""Breaches of glTF that change nothing for refinement: refined, and reported as found."""

import numpy as np
import pytest

from tests.service.gltf.read.refused import refine
from tests.service.gltf.read.test_refusals import EXTENSIONS, edited
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron

FOUND = "found, and left: "


def found(made):
    """The breaches that the report names: pointer, words, count."""
    return [
        (change["pointer"], change["what"].removeprefix(FOUND), change["count"])
        for change in made.report["changes"]
        if change["what"].startswith(FOUND)
    ]


def assert_found(made, pointer, says, count=1):
    ((place, words, number),) = found(made)
    assert (place, number, says in words) == (pointer, count, True), words


def refined(tree, binary):
    return refine(files.pack(tree, binary))


def positions(made, **place):
    return files.primitive_of(made.glb, **place)[1]["POSITION"]


def test_colours_of_plain_integers_are_averaged():
    colours = (40 * np.arange(24) % 256).astype(np.uint8).reshape(6, 4)
    made = refine(files.glb([octahedron(COLOR_0=colours)]))
    right = refine(files.glb([octahedron(COLOR_0=files.Normalized(colours))]))
    (_, kept), (_, wanted) = files.primitive_of(made.glb), files.primitive_of(right.glb)
    assert np.array_equal(kept["COLOR_0"], wanted["COLOR_0"])
    assert not np.isin(kept["COLOR_0"], colours).all()
    tree, _ = files.unpack(made.glb)
    accessor = tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
    assert "normalized" not in tree["accessors"][accessor]
    assert_found(made, "/accessors/2", "COLOR_n")
    assert found(right) == []


@pytest.mark.parametrize(
    ("start", "stride", "kind", "pointer", "says"),
    [
        *((0, s, np.uint8, "/bufferViews/2/byteStride", "byteStride") for s in (0, 1, 2, 3, 6)),
        *((0, s, np.uint8, "/bufferViews/2/byteStride", "byteStride") for s in (253, 256, 4096)),
        (1, 8, np.float32, "/accessors/2", "begin"),
    ],
)
def test_elements_are_read_where_they_lie(start, stride, kind, pointer, says):
    """At an odd stride, or not aligned."""
    tree, binary = files.document([octahedron()])
    values = (7 * np.arange(6)).astype(kind).reshape(6, 1)
    offset = len(binary) + -len(binary) % 4
    rows = b"".join(row.tobytes().ljust(stride or row.nbytes, b"\xcd") for row in values)
    binary = bytes(binary).ljust(offset, b"\0") + b"\xcd" * start + rows
    view = {"buffer": 0, "byteOffset": offset, "byteLength": len(binary) - offset}
    tree["bufferViews"].append(view | {"byteStride": stride})
    accessor = {"bufferView": len(tree["bufferViews"]) - 1, "byteOffset": start, "count": 6}
    accessor |= {"componentType": files.COMPONENTS[values.dtype.str[1:]], "type": "SCALAR"}
    tree["accessors"].append(accessor)
    tree["meshes"][0]["primitives"][0]["attributes"]["_ID"] = len(tree["accessors"]) - 1
    tree["buffers"] = [{"byteLength": len(binary)}]
    made = refined(tree, binary)
    _, attributes = files.primitive_of(made.glb)
    # Each of the first six refined vertices is on an axis: that of the old one.
    old = (attributes["POSITION"][:6] @ octahedron()["POSITION"].T).argmax(axis=1)
    assert np.array_equal(attributes["_ID"][:6], values[old])
    assert_found(made, pointer, says)


@pytest.mark.parametrize("empty", [{"primitives": []}, {"name": "nothing"}])
def test_a_mesh_without_primitives_stays_as_it_is(empty):
    tree, binary = files.document([octahedron()])
    tree["meshes"].insert(0, empty)
    tree["nodes"] = [{"mesh": 0}, {"mesh": 1}]
    made = refined(tree, binary)
    assert files.unpack(made.glb)[0]["meshes"][0] == empty
    assert made.report["totals"]["meshes"] == 1
    assert found(made) == [("/meshes/0", "meshes without primitives", 1)]


@pytest.mark.parametrize(
    ("nodes", "pointer", "count"),
    [
        ([{"children": [2]}, {"children": [2]}, {"mesh": 0}], "/nodes/1/children/0", 1),
        ([{"children": [1, 1, 1]}, {"mesh": 0}], "/nodes/0/children/1", 2),
    ],
)
def test_a_node_with_several_parents_is_left(nodes, pointer, count):
    assert_found(refine(edited("/nodes", nodes)), pointer, "more than one parent", count)


def test_quantisation_that_nobody_declared_is_read():
    shape = octahedron()
    shape["POSITION"] = (100 * shape["POSITION"]).astype(np.int8)
    made = refine(files.glb([shape], [shape]))
    plain = refine(files.glb([octahedron(POSITION=100 * octahedron()["POSITION"])]))
    assert np.array_equal(positions(made), positions(plain))
    assert_found(made, "/accessors/0", "KHR_mesh_quantization", 2)
    tree, binary = files.document([shape])
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    assert found(refined(tree, binary)) == []


def test_what_is_made_anew_is_not_believed_and_the_rest_is_neither_followed_nor_lost():
    tree, binary = files.document([octahedron()])
    tree["accessors"][0].update(min=[9, 9, 9], max=[-9, -9, -9])
    tree["bufferViews"][0]["target"] = 34963
    tree["meshes"][0]["primitives"][0]["extensions"] = {"EXT_of_nobody": {}}
    uris = ["../../etc/passwd", "https://example.com/a.png", "data:image/png;base64,AAAA"]
    kept = {"never": {"heard": "of"}, "images": [{"uri": uri} for uri in uris]}
    made = refined(tree | kept, binary)
    assert found(made) == []
    tree, binary = files.unpack(made.glb)
    position = tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    points = files.values_of(tree, binary, position)
    assert tree["accessors"][position]["min"] == points.min(axis=0).tolist()
    assert tree["bufferViews"][tree["accessors"][position]["bufferView"]]["target"] == 34962
    assert kept.items() <= tree.items()


def test_features_that_do_not_go_by_the_numbers_of_vertices_are_taken():
    sets = [{"featureCount": 3, "attribute": 0}, {"featureCount": 3, "texture": {"index": 0}}]
    extensions = {"EXT_mesh_features": {"featureIds": sets}}
    tree, _ = files.unpack(refine(edited(EXTENSIONS, extensions)).glb)
    assert tree["meshes"][0]["primitives"][0]["extensions"] == extensions


def test_a_target_that_a_primitive_lacks_moves_it_nowhere():
    """As with a target of zeros, also where it meets another that has one."""
    upper, lower = octahedron(), octahedron()
    upper["indices"], lower["indices"] = np.split(octahedron()["indices"].reshape(-1), 2)
    lifted = upper | {"targets": [{"POSITION": np.tile([0, 0, 1.0], (6, 1))}]}
    still = lower | {"targets": [{"POSITION": np.zeros((6, 3))}]}
    made, right = refine(files.glb([lifted, lower])), refine(files.glb([lifted, still]))
    for primitive in (0, 1):
        kept, wanted = (positions(each, primitive=primitive) for each in (made, right))
        np.testing.assert_array_equal(kept, wanted)
    tree, _ = files.unpack(made.glb)
    assert [len(each.get("targets", [])) for each in tree["meshes"][0]["primitives"]] == [1, 0]
    assert_found(made, "/meshes/0", "morph targets that not all")
    assert found(right) == []


def with_fractions(value):
    """Every number as a float, as JSON of programs that have no integers."""
    if isinstance(value, dict):
        return {key: with_fractions(part) for key, part in value.items()}
    if isinstance(value, list):
        return [with_fractions(part) for part in value]
    return float(value) if isinstance(value, int) else value


def test_integers_with_a_fraction_are_read_as_integers():
    tree, binary = files.document([octahedron()])
    tree["nodes"][0] |= {"translation": [1, 2, 0.5], "extras": {"size": 3.0}}
    plain, made = refined(tree, binary), refined(with_fractions(tree), binary)
    (change,) = [change for change in made.report["changes"] if "integers" in change["what"]]
    assert change["pointer"] == "/buffers/0/byteLength"
    before, after = (files.unpack(each.glb)[0] for each in (plain, made))
    # In what applications keep nothing is changed, not even how it is spelt.
    assert isinstance(after["nodes"][0]["extras"]["size"], float)
    assert (after["nodes"], after["accessors"]) == (before["nodes"], before["accessors"])
    assert isinstance(after["nodes"][0]["mesh"], int)
