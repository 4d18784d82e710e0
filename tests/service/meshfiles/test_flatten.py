"""A scene as plain triangles: where its nodes put them, and what shows none."""

import numpy as np
import pytest

from service.errors import GltfError, LimitError, UnrefinableError
from service.meshfiles.convert import converted
from service.meshfiles.formats import read, write
from service.options import Limits, Options
from service.stages import Stages
from tests.support.gltf import files
from tests.support.gltf.flattened import flatten
from tests.support.gltf.shapes import octahedron


def told_of(changes):
    return {change.what: change.count for change in changes}


def copied(**attributes):
    """An octahedron that a node of scale 2 shows in copies."""
    tree, binary = files.document([octahedron()])
    indices = {name: files.add_accessor(tree, binary, v) for name, v in attributes.items()}
    tree["buffers"] = [{"byteLength": len(binary)}]
    tree["nodes"][0] |= {
        "scale": [2, 2, 2],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": indices}},
    }
    tree["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    return files.pack(tree, binary)


def test_every_copy_stands_where_its_attributes_put_it():
    half = np.sqrt(0.5)
    turns = np.array([[0, 0, 0, 1], [0, 0, half, half]])
    shifts, scales = np.array([[0, 0, 0], [10, 0, 0]]), np.array([[1, 1, 1], [3, 1, 1]])
    data = copied(TRANSLATION=shifts, ROTATION=turns, SCALE=scales)
    flat, _ = flatten(data, "stl", Limits())
    assert len(flat.faces) == 16
    second = flat.vertices[flat.faces[8:]].reshape(-1, 3)
    # Its longer axis, x, is turned to y; then it is moved, and all is twice as large.
    expected = [[2 * (10 - 1), -2 * 3, -2], [2 * (10 + 1), 2 * 3, 2]]
    np.testing.assert_allclose([second.min(axis=0), second.max(axis=0)], expected, atol=1e-5)


@pytest.mark.parametrize("copies", [60_000, 4000])
def test_copies_that_cost_too_much_are_refused_before_anything_is_refined(copies):
    """Each costs its faces, eight or 512 of them, and what placing one takes."""
    data, begun = copied(TRANSLATION=np.zeros((copies, 3))), list[str]()
    options = Options(scheme="loop", levels=1 if copies > 10_000 else 4)
    stages = Stages(begins=begun.append)
    with pytest.raises(LimitError, match="with all copies") as refused:
        converted(data, "glb", "stl", options, None, Limits(), stages)
    assert (refused.value.limit, refused.value.status, begun) == ("faces", 413, ["read"])


def test_copies_that_their_accessors_do_not_agree_on_are_refused():
    data = copied(TRANSLATION=np.zeros((2, 3)), SCALE=np.ones((3, 3)))
    with pytest.raises(GltfError, match="as many values"):
        flatten(data, "stl", Limits())


@pytest.mark.parametrize(
    ("name", "values"),
    [
        *(("translation", [1, 2]), ("rotation", ["a", 0, 0, 1])),
        *(("scale", values) for values in ([[1], [1], [1]], {})),
        *(("matrix", values) for values in ([1.0] * 15, "data:,")),
    ],
)
def test_a_node_that_stands_nowhere_is_refused(name, values):
    tree, binary = files.document([octahedron()])
    tree["nodes"][0][name] = values
    with pytest.raises(GltfError, match=f"{name} must be") as refused:
        flatten(files.pack(tree, binary), "obj", Limits())
    assert refused.value.pointer == f"/nodes/0/{name}"


def test_texture_coordinates_are_written_as_the_material_transforms_them():
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.25, 0.75]], dtype=np.float32)
    tree, binary = files.document([{**octahedron(), "TEXCOORD_0": uv}])
    transform = {"offset": [0.5, 0.25], "scale": [2, 3], "rotation": np.pi / 2}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": texture}}]
    tree["textures"] = [{}]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    tree["extensionsUsed"] = ["KHR_texture_transform"]
    flat, _ = flatten(files.pack(tree, binary), "obj", Limits())
    # A quarter turn counter-clockwise, as the image lies: u goes up, which is to smaller v.
    expected = np.column_stack([3 * uv[:, 1] + 0.5, 1 - (-2 * uv[:, 0] + 0.25)])
    layer = flat.layers["TEXCOORD_0"]
    corners = octahedron()["indices"].reshape(-1)
    np.testing.assert_allclose(layer.values[layer.rows], expected[corners], atol=1e-6)


def test_names_colours_and_normals_follow_a_mesh_into_an_obj():
    shape = {**octahedron(), "COLOR_0": np.tile(np.float32([1, 0.5, 0]), (6, 1))}
    shape["NORMAL"] = octahedron()["POSITION"]
    tree, binary = files.document([shape])
    tree["materials"] = [{"name": "brass"}]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    tree["nodes"][0] |= {"name": "knob", "scale": [1, 1, 4]}
    flat, _ = flatten(files.pack(tree, binary), "obj", Limits())
    assert flat.labels["material"].names == ("brass",)
    assert flat.labels["object"].names == ("knob",)
    assert flat.layers["COLOR_0"].values.tolist() == [[1, 0.5, 0]] * 6
    text = write(flat, "obj").decode()
    assert "usemtl brass\n" in text
    assert "o knob\n" in text
    assert "v 1 0 0 1 0.5 0\n" in text
    assert "f 1//1" in text


def test_a_node_with_several_parents_stands_once_and_that_is_told():
    """Each but the last is twice the parent of the next: it stood there a million times."""
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"children": [number + 1] * 2} for number in range(20)] + [{"mesh": 0}]
    for told in (True, False):
        tree["scenes"] = [{"nodes": [0]}] if told else []
        if not told:
            del tree["scene"]
        flat, changes = flatten(files.pack(tree, binary), "obj", Limits())
        assert len(flat.faces) == 8
        (told_of,) = [change for change in changes if "several parents" in change.what]
        assert told_of.count == 20


def test_a_root_that_is_a_child_too_stands_where_its_parent_puts_it():
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"mesh": 0}, {"children": [0], "translation": [5, 0, 0]}]
    tree["scenes"][0]["nodes"] = [0, 1]
    flat, _ = flatten(files.pack(tree, binary), "obj", Limits())
    assert len(flat.faces) == 8
    assert flat.vertices[:, 0].min() == pytest.approx(4)


def test_what_the_scene_does_not_show_and_what_is_no_surface_are_told():
    moved = octahedron(targets=[{"POSITION": np.ones((6, 3))}] * 2)
    lines = {"POSITION": np.eye(3), "mode": 1}
    tree, binary = files.document([moved, {"POSITION": np.eye(3), "mode": 0}], [lines])
    tree["nodes"] += [{"mesh": 0}, {"mesh": 0}]
    tree["scenes"] += [{"nodes": [2]}]
    tree["skins"] = [{"joints": [0]}]
    _, changes = flatten(files.pack(tree, binary), "ply", Limits())
    # Of the nodes one of another scene, one of none.
    told = {"nodes outside of the default scene left out": 2}
    lost = {"points and lines": 2, "skins": 1, "morph targets": 2}
    told |= {f"{name} dropped: not written to PLY files": count for name, count in lost.items()}
    assert told.items() <= told_of(changes).items()
    tree["scenes"][0]["nodes"] = []
    with pytest.raises(UnrefinableError, match="shows no triangles"):
        flatten(files.pack(tree, binary), "obj", Limits())


def test_hidden_nodes_and_what_is_below_them_are_left_out_and_told():
    tree, binary = files.document([octahedron()])
    hidden, shown = ({"KHR_node_visibility": {"visible": visible}} for visible in (False, True))
    tree["nodes"] = [
        {"children": [1, 2], "extensions": hidden},
        {"mesh": 0, "extensions": shown},
        {"mesh": 0},
        {"mesh": 0, "translation": [5, 0, 0], "extensions": shown},
        {"mesh": 0},
    ]
    tree["scenes"][0]["nodes"] = [0, 3]
    flat, changes = flatten(files.pack(tree, binary), "obj", Limits())
    assert len(flat.faces) == 8
    assert flat.vertices[:, 0].min() == pytest.approx(4)
    told = told_of(changes)
    assert told["hidden nodes left out"] == 2
    assert told["nodes outside of the default scene left out"] == 1
    tree["scenes"][0]["nodes"] = [0]
    with pytest.raises(UnrefinableError, match="shows no triangles"):
        flatten(files.pack(tree, binary), "obj", Limits())


@pytest.mark.parametrize("weld", ["position", "index"])
def test_a_scene_has_the_triangles_of_the_glb_that_would_be_written(weld):
    """Whatever a node does: two primitives of one mesh, placed twice, once mirrored."""
    tree, binary = files.document([octahedron()])
    tree["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0], "scale": [-1, 1, 1]}]
    tree["scenes"][0]["nodes"] = [0, 1]
    asked = files.pack(tree, binary), "glb"
    options = Options(scheme="loop", levels=2, weld=weld)
    scene = read(converted(*asked, "ply", options, None, Limits()).content, "ply")
    glb = converted(*asked, "glb", options, None, Limits()).content
    expected, _ = flatten(glb, "ply", Limits())
    np.testing.assert_allclose(
        scene.vertices[scene.corners], expected.vertices[expected.corners], atol=1e-6
    )


def test_only_a_gltf_is_compressed():
    data = files.pack(*files.document([octahedron()]))
    options = Options(scheme="loop", levels=1, compress="draco")
    packed = converted(data, "glb", "ply", options, None, Limits())
    assert "not compressed: only a glTF is" in {c["what"] for c in packed.report["changes"]}
    plain = converted(data, "glb", "ply", Options(scheme="loop", levels=1), None, Limits())
    assert packed.content == plain.content
