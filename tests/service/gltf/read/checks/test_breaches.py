"""Breaches of glTF that change nothing for refinement: refined, and reported as found."""

import numpy as np
import pytest

from service.errors import GltfError
from tests.service.gltf.read.refused import refine
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


def lying(values, *, start, stride):
    """The rows at a stride, from a place in the bytes."""
    rows = b"".join(row.tobytes().ljust(stride or row.nbytes, b"\xcd") for row in values)
    return b"\xcd" * start + rows


def with_identifiers(*, start=0, stride=None, kind=np.uint8, width=1):
    """An octahedron whose `_ID` lies at the end of the bytes, and the numbers in it."""
    tree, binary = files.document([octahedron()])
    values = (7 * np.arange(6 * width) % 251).astype(kind).reshape(6, width)
    binary.extend(b"\0" * (-len(binary) % 4))
    view = {"buffer": 0, "byteOffset": len(binary)}
    binary.extend(lying(values, start=start, stride=stride))
    view["byteLength"] = len(binary) - view["byteOffset"]
    if stride is not None:
        view["byteStride"] = stride
    tree["bufferViews"].append(view)
    tree["accessors"].append(
        {
            "bufferView": len(tree["bufferViews"]) - 1,
            "byteOffset": start,
            "componentType": files.COMPONENTS[values.dtype.str[1:]],
            "count": 6,
            "type": files.TYPES[width],
        }
    )
    tree["meshes"][0]["primitives"][0]["attributes"]["_ID"] = len(tree["accessors"]) - 1
    tree["buffers"] = [{"byteLength": len(binary)}]
    return files.pack(tree, binary), values


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
    ((pointer, words, count),) = found(made)
    assert (pointer, count) == ("/accessors/2", 1)
    assert "COLOR_n" in words
    assert found(right) == []


@pytest.mark.parametrize("stride", [0, 1, 2, 3, 6, 253, 256, 4096])
def test_odd_strides_are_read_as_they_say(stride):
    data, values = with_identifiers(stride=stride)
    made = refine(data)
    _, attributes = files.primitive_of(made.glb)
    assert np.array_equal(attributes["_ID"][:6], values[first_rows(attributes)])
    ((pointer, words, count),) = found(made)
    assert (pointer, count) == ("/bufferViews/2/byteStride", 1)
    assert "byteStride" in words


def first_rows(attributes):
    """Return the old vertex that each of the first six refined ones is: that of its axis."""
    points = attributes["POSITION"][:6]
    old = octahedron()["POSITION"]
    return (points @ old.T).argmax(axis=1)


def test_elements_that_are_not_aligned_are_read_where_they_lie():
    data, values = with_identifiers(start=1, stride=8, kind=np.float32)
    made = refine(data)
    _, attributes = files.primitive_of(made.glb)
    assert np.array_equal(attributes["_ID"][:6], values[first_rows(attributes)])
    ((pointer, words, count),) = found(made)
    assert (pointer, count) == ("/accessors/2", 1)
    assert "begin" in words


@pytest.mark.parametrize("empty", [{"primitives": []}, {"name": "nothing"}])
def test_a_mesh_without_primitives_stays_as_it_is(empty):
    tree, binary = files.document([octahedron()])
    tree["meshes"].insert(0, empty)
    tree["nodes"] = [{"mesh": 0}, {"mesh": 1}]
    made = refine(files.pack(tree, binary))
    assert files.unpack(made.glb)[0]["meshes"][0] == empty
    assert made.report["totals"]["meshes"] == 1
    assert found(made) == [("/meshes/0", "meshes without primitives", 1)]


def test_quantisation_that_nobody_declared_is_read():
    shape = octahedron()
    shape["POSITION"] = (100 * shape["POSITION"]).astype(np.int8)
    made = refine(files.glb([shape], [shape]))
    plain = refine(files.glb([octahedron(POSITION=100 * octahedron()["POSITION"])]))
    assert np.array_equal(
        files.primitive_of(made.glb)[1]["POSITION"], files.primitive_of(plain.glb)[1]["POSITION"]
    )
    ((pointer, words, count),) = found(made)
    assert (pointer, count) == ("/accessors/0", 2)
    assert "KHR_mesh_quantization" in words
    tree, binary = files.document([shape])
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    assert found(refine(files.pack(tree, binary))) == []


def test_what_is_made_anew_is_not_believed():
    def edit(tree):
        tree["accessors"][0].update(min=[9, 9, 9], max=[-9, -9, -9])
        tree["bufferViews"][0]["target"] = 34963
        tree["meshes"][0]["primitives"][0]["extensions"] = {"EXT_of_nobody": {}}
        tree["never"] = {"heard": "of"}

    tree, binary = files.document([octahedron()])
    edit(tree)
    made = refine(files.pack(tree, binary))
    assert found(made) == []
    tree, binary = files.unpack(made.glb)
    position = tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    points = files.values_of(tree, binary, position)
    assert tree["accessors"][position]["min"] == points.min(axis=0).tolist()
    assert tree["bufferViews"][tree["accessors"][position]["bufferView"]]["target"] == 34962
    assert tree["never"] == {"heard": "of"}


def test_a_target_that_a_primitive_lacks_moves_it_nowhere():
    """As with a target of zeros, also where it meets another that has one."""
    upper, lower = octahedron(), octahedron()
    upper["indices"], lower["indices"] = np.split(octahedron()["indices"].reshape(-1), 2)
    lifted = upper | {"targets": [{"POSITION": np.tile([0, 0, 1.0], (6, 1))}]}
    still = lower | {"targets": [{"POSITION": np.zeros((6, 3))}]}
    made, right = refine(files.glb([lifted, lower])), refine(files.glb([lifted, still]))
    for primitive in (0, 1):
        (_, kept), (_, wanted) = (
            files.primitive_of(each.glb, primitive=primitive) for each in (made, right)
        )
        np.testing.assert_array_equal(kept["POSITION"], wanted["POSITION"])
    tree, _ = files.unpack(made.glb)
    assert [len(each.get("targets", [])) for each in tree["meshes"][0]["primitives"]] == [1, 0]
    ((pointer, words, count),) = found(made)
    assert (pointer, count) == ("/meshes/0", 1)
    assert "morph targets that not all" in words
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
    plain = refine(files.pack(tree, binary))
    made = refine(files.pack(with_fractions(tree), binary))
    (change,) = [change for change in made.report["changes"] if "integers" in change["what"]]
    assert change["pointer"] == "/buffers/0/byteLength"
    after = files.unpack(made.glb)[0]
    # In what applications keep nothing is changed, not even how it is spelt.
    assert isinstance(after["nodes"][0]["extras"]["size"], float)
    assert after["nodes"] == files.unpack(plain.glb)[0]["nodes"]
    assert after["accessors"] == files.unpack(plain.glb)[0]["accessors"]
    assert isinstance(after["nodes"][0]["mesh"], int)


@pytest.mark.parametrize("number", [1.5, 2.0**60, -1.0])
def test_numbers_that_are_no_integers_are_refused_where_they_stand(number):
    tree, binary = files.document([octahedron()])
    tree["accessors"][0]["count"] = number
    with pytest.raises(GltfError) as refused:
        refine(files.pack(tree, binary))
    assert refused.value.pointer == "/accessors/0/count"
