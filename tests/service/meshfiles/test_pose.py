"""Skinned meshes as other formats get them: where their joints put them, as every viewer does."""

import numpy as np
import pytest

from service.errors import GltfError
from service.meshfiles.mesh_file import NORMAL
from service.options import Limits
from tests.support.gltf import files
from tests.support.gltf.flattened import flatten
from tests.support.gltf.shapes import octahedron

# A quarter turn about z.
TURN = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def skinned(joints, weights, inverse=None):
    """(tree, BIN): the node of an octahedron is a hundred times as large, its joints are not."""
    names = {"JOINTS_0": np.array(joints, np.uint8), "WEIGHTS_0": np.array(weights, np.float32)}
    tree, binary = files.document([{**octahedron(), **names}])
    tree["nodes"] = [
        {"mesh": 0, "skin": 0, "scale": [100, 100, 100]},
        {"translation": [5, 0, 0], "children": [2]},
        {"rotation": [0, 0, 2**-0.5, 2**-0.5]},
    ]
    tree["scenes"][0]["nodes"] = [0, 1]
    tree["skins"] = [{"joints": [1, 2]}]
    if inverse is not None:
        # Column by column.
        stored = np.asarray(inverse).transpose(0, 2, 1).reshape(-1, 16)
        tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(binary), "byteLength": stored.size * 4}
        )
        view = len(tree["bufferViews"]) - 1
        tree["accessors"].append(
            {"bufferView": view, "componentType": 5126, "count": len(stored), "type": "MAT4"}
        )
        binary += stored.astype("<f4").tobytes()
        tree["buffers"] = [{"byteLength": len(binary)}]
        tree["skins"][0]["inverseBindMatrices"] = len(tree["accessors"]) - 1
    return tree, binary


def corners(tree, binary, kind="stl"):
    flat, _ = flatten(files.pack(tree, binary), kind, Limits())
    return flat.vertices[flat.faces]


def own_corners():
    return octahedron()["POSITION"][np.asarray(octahedron()["indices"]).reshape(-1, 3)]


def test_joints_place_a_skinned_mesh_and_its_node_does_not():
    bound = np.diag([0.5, 0.5, 0.5, 1.0])
    share = np.linspace(0, 1, 6)
    pairs, weights = np.tile([0, 1, 0, 0], (6, 1)), np.zeros((6, 4))
    weights[:, 0], weights[:, 1] = share, 1 - share
    placed = corners(*skinned(pairs, weights, [bound, bound @ TURN]))
    first = 0.5 * octahedron()["POSITION"] + [5, 0, 0]
    x, y, z = octahedron()["POSITION"].T
    # Half a turn, by the joint and by how it was bound.
    second = 0.5 * np.stack([-x, -y, z], axis=1) + [5, 0, 0]
    expected = share[:, None] * first + (1 - share[:, None]) * second
    faces = np.asarray(octahedron()["indices"]).reshape(-1, 3)
    np.testing.assert_allclose(placed, expected[faces], atol=1e-6)


def test_what_joints_mirror_still_faces_outwards():
    tree, binary = skinned([[0, 0, 0, 0]] * 6, [[1, 0, 0, 0]] * 6)
    tree["nodes"][1]["scale"] = [-1, 1, 1]
    a, b, c = corners(tree, binary).transpose(1, 0, 2) - [5, 0, 0]
    assert (np.linalg.det(np.stack([a, b, c], axis=1)) > 0).all()


def test_a_mesh_that_stands_as_it_was_bound_keeps_its_bits():
    tree, binary = skinned([[1, 0, 0, 0]] * 6, [[1, 0, 0, 0]] * 6, [np.eye(4), TURN.T])
    tree["nodes"][0] = {"mesh": 0, "skin": 0, "translation": [5, 0, 0]}
    np.testing.assert_array_equal(corners(tree, binary), own_corners() + np.float32([5, 0, 0]))


@pytest.mark.parametrize(
    ("joint", "inverse", "says"),
    [
        (2, [np.eye(4)] * 2, "joint 2 of 2"),
        (1, [np.eye(4)], "2 joints need as many MAT4"),
        (1, [np.eye(4), np.full((4, 4), np.nan)], "finite"),
    ],
)
def test_joints_and_matrices_that_there_are_not_are_told(joint, inverse, says):
    tree, binary = skinned([[joint, 0, 0, 0]] * 6, [[1, 0, 0, 0]] * 6, inverse)
    with pytest.raises(GltfError, match=says):
        corners(tree, binary)


@pytest.mark.parametrize(("kind", "counts"), [("ply", [1]), ("stl", [])])
def test_normals_that_joints_would_turn_are_told(kind, counts):
    tree, binary = skinned([[1, 0, 0, 0]] * 6, [[1, 0, 0, 0]] * 6)
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["NORMAL"] = attributes["POSITION"]
    flat, changes = flatten(files.pack(tree, binary), kind, Limits())
    assert NORMAL not in flat.layers
    told = [each.count for each in changes if each.what == "normals of skinned meshes left out"]
    assert told == counts


def test_joints_of_another_scene_place_nothing():
    tree, binary = skinned([[1, 0, 0, 0]] * 6, [[1, 0, 0, 0]] * 6)
    tree["scenes"][0]["nodes"] = [0]
    np.testing.assert_array_equal(corners(tree, binary), 100 * own_corners())


@pytest.mark.parametrize(
    ("of_mesh", "of_node", "shown"),
    [([0.5, 1], None, [0.5, 1]), ([0.5, 1], [0, 2], [0, 2]), (None, [1e39, 0], [1e39, 0])],
)
def test_morph_targets_stand_as_their_weights_show_them(of_mesh, of_node, shown):
    rng = np.random.default_rng(0)
    deltas = rng.normal(size=(2, 6, 3)).astype(np.float32)
    shape = {**octahedron(), "targets": [{"POSITION": delta} for delta in deltas]}
    tree, binary = files.document([shape])
    tree["meshes"][0] |= {} if of_mesh is None else {"weights": of_mesh}
    tree["nodes"][0] |= {} if of_node is None else {"weights": of_node}
    faces = np.asarray(octahedron()["indices"]).reshape(-1, 3)
    expected = octahedron()["POSITION"] + np.tensordot(shown, deltas, axes=1)
    np.testing.assert_allclose(corners(tree, binary), expected[faces], rtol=1e-6)
