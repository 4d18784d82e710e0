"""Morph targets: linear in their weights, exact at weight 0, and Loop's own at weight 1."""

import numpy as np
import pytest

from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.service.gltf.subdivided import subdivide
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import box, octahedron


def deltas(seed, count=6, size=0.3):
    return size * np.random.default_rng(seed).standard_normal((count, 3))


def box_deltas(seed, names):
    """Deltas for the 24 corners of a box that agree where positions do."""
    _, corner = np.unique(box()["POSITION"], axis=0, return_inverse=True)
    moved = deltas(seed, 8)[corner.reshape(-1)]
    return {name: moved if name == "POSITION" else deltas(seed + 1, 24, 0.1) for name in names}


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("limit", [False, True])
def test_at_weight_one_loop_refines_the_morphed_mesh(levels, limit):
    shape, moved = octahedron(), deltas(0)
    morphed = octahedron(POSITION=(shape["POSITION"] + moved).astype(np.float32))
    exact = morphed["POSITION"] - shape["POSITION"]
    options = {"levels": levels, "limit": limit}
    result = subdivide([octahedron(targets=[{"POSITION": exact}])], **options).glb
    faces, attributes = files.primitive_of(result)
    (target,) = files.targets_of(result)
    expected_faces, expected = files.primitive_of(subdivide([morphed], **options).glb)
    np.testing.assert_allclose(
        (attributes["POSITION"] + target["POSITION"])[faces],
        expected["POSITION"][expected_faces],
        atol=1e-6,
    )


@pytest.mark.parametrize("scheme", ["loop", "pns"])
@pytest.mark.parametrize("levels", [1, 2])
def test_at_weight_zero_it_is_the_mesh_without_targets(scheme, levels):
    names = ("POSITION", "NORMAL", "TANGENT")
    plain = files.primitive_of(subdivide([box()], scheme=scheme, levels=levels).glb)
    result = subdivide([box(targets=[box_deltas(0, names)])], scheme=scheme, levels=levels)
    faces, attributes = files.primitive_of(result.glb)
    # Morph targets may cut vertices apart, and so number them otherwise: compare by corner.
    for name, values in plain[1].items():
        np.testing.assert_array_equal(attributes[name][faces], values[plain[0]])


def test_the_correction_is_frozen_so_targets_are_linear():
    shape, first, second = octahedron(), deltas(0), deltas(1)
    result = subdivide(
        [octahedron(targets=[{"POSITION": d} for d in (first, second, 2 * first + second)])],
        scheme="pns",
        levels=2,
    ).glb
    by_first, by_second, both = (target["POSITION"] for target in files.targets_of(result))
    np.testing.assert_allclose(both, 2 * by_first + by_second, atol=1e-6)
    # They are those of Loop, whatever the scheme.
    by_loop = subdivide([octahedron(targets=[{"POSITION": first}])], levels=2).glb
    np.testing.assert_array_equal(
        by_first[files.primitive_of(result)[0]],
        files.targets_of(by_loop)[0]["POSITION"][files.primitive_of(by_loop)[0]],
    )
    assert shape["POSITION"].shape == first.shape


# Of the limit surface's normals the morph changes as much as averages of faces change.
@pytest.mark.parametrize(("limit", "close"), [(False, 2e-5), (True, 5e-3)])
def test_morphed_normals_are_those_of_the_morphed_surface(limit, close):
    moved = box_deltas(3, ["POSITION", "NORMAL"])
    # So little that the box's normals say nothing else than the morphed faces do.
    moved["POSITION"] *= 0.1
    morphed = box(POSITION=(box()["POSITION"] + moved["POSITION"]).astype(np.float32))
    moved["POSITION"] = morphed["POSITION"] - box()["POSITION"]
    result = subdivide([box(targets=[moved])], levels=2, limit=limit).glb
    faces, attributes = files.primitive_of(result)
    (target,) = files.targets_of(result)
    expected_faces, expected = files.primitive_of(subdivide([morphed], levels=2, limit=limit).glb)
    normals = (attributes["NORMAL"] + target["NORMAL"])[faces]
    np.testing.assert_allclose(normals, expected["NORMAL"][expected_faces], atol=close)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)


def test_morphed_tangents_run_as_those_of_the_morphed_mesh():
    moved = {"TANGENT": deltas(4, 24, 0.3)}
    given = box()["TANGENT"].copy()
    given[:, :3] += moved["TANGENT"]
    result = subdivide([box(targets=[moved])], levels=2).glb
    faces, attributes = files.primitive_of(result)
    (target,) = files.targets_of(result)
    expected_faces, expected = files.primitive_of(subdivide([box(TANGENT=given)], levels=2).glb)
    np.testing.assert_allclose(
        (attributes["TANGENT"][:, :3] + target["TANGENT"])[faces],
        expected["TANGENT"][expected_faces][..., :3],
        atol=1e-6,
    )


def test_tangents_under_a_target_without_normals_are_perpendicular_to_those_at_rest():
    """Also where another primitive of the mesh has some there."""
    names = ("POSITION", "NORMAL", "TANGENT")
    moved = box_deltas(5, names)
    aside = box(POSITION=box()["POSITION"] + 9, targets=[{n: moved[n] for n in names[::2]}])
    result = subdivide([box(targets=[moved]), aside], levels=2).glb
    _, attributes = files.primitive_of(result, 0, 1)
    (target,) = files.targets_of(result, 0, 1)
    tangents = attributes["TANGENT"][:, :3] + target["TANGENT"]
    np.testing.assert_allclose((tangents * attributes["NORMAL"]).sum(axis=1), 0, atol=1e-5)


def test_targets_without_normals_get_none_and_others_are_linear():
    names = ["POSITION", "COLOR_0", "TEXCOORD_0"]
    given = box_deltas(7, names)
    given["TEXCOORD_0"] = given["TEXCOORD_0"][:, :2]
    shape = box(COLOR_0=np.ones((24, 3)), targets=[given, {"TEXCOORD_0": given["TEXCOORD_0"]}])
    result = subdivide([shape]).glb
    targets = files.targets_of(result)
    assert [list(target) for target in targets] == [names, ["TEXCOORD_0"]]
    faces, _ = files.primitive_of(result)
    corners = given["COLOR_0"][shape["indices"]]
    middle = (corners + np.roll(corners, -1, axis=1)) / 2
    np.testing.assert_allclose(targets[0]["COLOR_0"][faces[3::4]], middle, atol=1e-6)


def test_a_target_that_moves_normals_alone_keeps_its_own():
    moved = np.repeat(deltas(6, 6, 0.1), 4, axis=0)
    result = subdivide([box(targets=[{"NORMAL": moved}])], levels=2).glb
    faces, _ = files.primitive_of(result)
    (target,) = files.targets_of(result)
    # The same at all corners of a side, and so everywhere on it.
    sides = target["NORMAL"][faces].reshape(6, -1, 3)
    np.testing.assert_allclose(sides, np.broadcast_to(moved[::4, None], sides.shape), atol=1e-6)


@pytest.mark.parametrize("others", [[{"POSITION": np.full((6, 3), -0.0)}], [{}], []])
def test_a_zero_of_either_sign_or_none_moves_nothing_apart(others):
    shape, still = octahedron(), [{"POSITION": np.zeros((6, 3))}]
    halves = [
        octahedron(indices=shape["indices"][at], targets=targets)
        for at, targets in ((slice(4), still), (slice(4, 8), others))
    ]
    assert subdivide(halves).report["levels"][0]["edges"]["boundary"] == 0


def test_closed_lips_that_part_stay_two():
    # A flat square, cut along its diagonal by a target that moves one side of the cut.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    apart = np.repeat([[0.0, 0, 0], [0, 0, 1]], 3, axis=0)
    for moved, rim in ((0 * apart, 4), (apart, 6)):
        lips = {"POSITION": points, "indices": faces, "targets": [{"POSITION": moved}]}
        report = subdivide([lips]).report
        assert report["levels"][0]["edges"]["boundary"] == rim


def test_primitives_of_one_mesh_morph_together_across_their_common_edge():
    shape, moved = octahedron(), deltas(9)
    halves = [
        octahedron(indices=shape["indices"][at], targets=[{"POSITION": moved}])
        for at in (slice(4), slice(4, 8))
    ]
    result = subdivide(halves, levels=2).glb
    position_at = {}
    for number in (0, 1):
        _, attributes = files.primitive_of(result, 0, number)
        (target,) = files.targets_of(result, 0, number)
        for point, delta in zip(attributes["POSITION"].tolist(), target["POSITION"], strict=True):
            np.testing.assert_array_equal(position_at.setdefault(tuple(point), delta), delta)
    assert len(position_at) == 66


@pytest.mark.spawning
def test_weights_names_and_bounds_stay_valid(tmp_path):
    names = ("POSITION", "NORMAL", "TANGENT")
    tree, binary = files.document([box(targets=[box_deltas(n, names) for n in (0, 3)])])
    tree["meshes"][0] |= {"weights": [0.5, 0.25], "extras": {"targetNames": ["a", "b"]}}
    times = files.add_accessor(tree, binary, np.array([[0.0], [1.0]]))
    tree["accessors"][times] |= {"min": [0], "max": [1]}
    output = files.add_accessor(tree, binary, np.array([[0.0], [1], [1], [0]]))
    tree["buffers"][0]["byteLength"] = len(binary)
    for view in tree["bufferViews"][-2:]:
        view.pop("byteStride", None)
    target = {"node": 0, "path": "weights"}
    tree["animations"] = [
        {
            "channels": [{"sampler": 0, "target": target}],
            "samplers": [{"input": times, "output": output}],
        }
    ]
    first = tree["meshes"][0]["primitives"][0]["targets"][0]["POSITION"]
    tree["accessors"][first] |= {"name": "smile", "extras": {"by": "hand"}}
    data = files.pack(tree, binary)
    result = subdivide_gltf(data, "glb", Options(scheme="loop", levels=2), None, Limits())
    after, _ = files.unpack(result.glb)
    assert after["animations"][0]["channels"] == tree["animations"][0]["channels"]
    written = after["accessors"][after["meshes"][0]["primitives"][0]["targets"][0]["POSITION"]]
    assert (written["name"], written["extras"]) == ("smile", {"by": "hand"})
    for key in ("weights", "extras"):
        assert after["meshes"][0][key] == tree["meshes"][0][key]
    for index, values in zip(
        [target["POSITION"] for target in after["meshes"][0]["primitives"][0]["targets"]],
        [target["POSITION"] for target in files.targets_of(result.glb)],
        strict=True,
    ):
        assert after["accessors"][index]["min"] == values.min(axis=0).tolist()
        assert after["accessors"][index]["max"] == values.max(axis=0).tolist()
    paths = [tmp_path / "before.glb", tmp_path / "after.glb"]
    for path, content in zip(paths, (data, result.glb), strict=True):
        path.write_bytes(content)
    before, now = validator.errors(paths)
    assert set(now) <= set(before)
