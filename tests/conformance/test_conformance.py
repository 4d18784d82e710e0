"""Every asset of the collection comes back whole: shown by readers that are not ours."""

import json

import numpy as np
import pytest

from service.errors import ServiceError
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.conformance.collection import NAMES, REFUSED, ROWS, Conformance, refined
from tests.conformance.surfaces import loop_step, open_edges, proper, welded
from tests.support.gltf import files

pytestmark = [
    pytest.mark.skipif(not NAMES, reason="needs the assets of the shared data"),
    pytest.mark.conformance,
]

ASSET = pytest.mark.parametrize("name", NAMES)
# `make exhaustive` takes the second level too.
LEVEL = pytest.mark.parametrize("levels", [1, pytest.param(2, marks=pytest.mark.exhaustive)])
# Their values may change: geometry, and what says where it is.
GEOMETRY = {"accessors", "bufferViews", "buffers", "meshes"}
# Withdrawn where nothing in the file needs them any more.
STORAGE = {
    "KHR_mesh_quantization",
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
}


@pytest.fixture(scope="session")
def conformance(tmp_path_factory):
    return Conformance(tmp_path_factory.mktemp("refined"))


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_with_a_pointer(name):
    with pytest.raises(ServiceError) as refusal:
        refined(name, 1)
    assert (refusal.value.code, refusal.value.pointer) == REFUSED[name]


@ASSET
@LEVEL
def test_the_validator_finds_no_error_that_was_not_there(conformance, name, levels):
    before = conformance.errors(name, 0, None)
    assert conformance.errors(name, levels, "pns") <= before


@ASSET
@LEVEL
def test_three_js_loads_it_with_its_skins_and_targets(conformance, name, levels):
    before = conformance.loaded(name, 0, None)
    after = conformance.loaded(name, levels, "pns")
    assert "error" not in after
    assert after["skinned"] == before["skinned"]
    for old, new in zip(before["meshes"], after["meshes"], strict=True):
        assert [p["triangles"] for p in new] == [p["triangles"] for p in old]
        assert [len(p["targets"]) for p in new] == [len(p["targets"]) for p in old]
        assert [set(p) for p in new] == [set(p) for p in old]


@ASSET
@LEVEL
def test_each_face_becomes_four_at_each_level(conformance, name, levels):
    before, after = (conformance.meshes(name, *setting) for setting in ((0, None), (levels, "pns")))
    dropped = 0
    for old, new in zip(before, after, strict=True):
        _, faces = welded(old)
        kept = np.split(proper(faces), np.cumsum([len(p["faces"]) for p in old])[:-1])
        for p, keep in zip(new, kept, strict=True):
            # A primitive of which nothing is left stays as it was.
            assert len(p["faces"]) == (keep.sum() * 4**levels or len(keep))
            dropped += (~keep).sum()
    assert refined(name, levels).report["dropped"]["degenerate_faces"] == dropped
    assert sum(len(p["faces"]) for mesh in before for p in mesh) == int(ROWS[name]["faces"])


@ASSET
@LEVEL
def test_seams_do_not_crack_and_watertight_stays_watertight(conformance, name, levels):
    rims = [
        [open_edges(welded(mesh)[1]) for mesh in conformance.meshes(name, *setting)]
        for setting in ((0, None), (levels, "pns"))
    ]
    assert rims[1] == [rim * 2**levels for rim in rims[0]]
    tight, meshes = ROWS[name]["watertight"].split("/")
    if tight == meshes:
        assert not any(rims[1])


@ASSET
@LEVEL
def test_loop_equals_an_independent_implementation(conformance, name, levels):
    coarse = (0, None) if levels == 1 else (levels - 1, "loop")
    for old, new in zip(
        conformance.meshes(name, *coarse), conformance.meshes(name, levels, "loop"), strict=True
    ):
        points, faces = welded(old)
        expected, sure = loop_step(points, faces)
        ends = np.cumsum([len(p["faces"]) for p in old])
        for p, where in zip(new, np.split(np.arange(len(faces)), ends[:-1]), strict=True):
            kept = where[proper(faces[where])]
            if not len(kept):
                continue
            corners = p["points"][p["faces"].reshape(-1, 4, 3)]
            surface = np.concatenate([corners[:, :3, 0], corners[:, 3]], axis=1)
            size = np.ptp(points, axis=0).max()
            np.testing.assert_allclose(
                surface[sure[kept]], expected[kept][sure[kept]], atol=1e-6 * size
            )


def test_the_independent_loop_covers_most_of_the_collection(conformance):
    sure = [loop_step(*welded(mesh))[1] for mesh in conformance.originals()]
    assert np.concatenate(sure).mean() > 0.6


@ASSET
@LEVEL
def test_weights_sum_to_one(name, levels):
    tree, binary = files.unpack(refined(name, levels).glb)
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            weights = [
                files.values_of(tree, binary, index)
                for key, index in primitive["attributes"].items()
                if key.startswith("WEIGHTS_")
            ]
            if weights:
                rows = np.hstack(weights)
                full = 1 if rows.dtype.kind == "f" else np.iinfo(rows.dtype).max
                assert (rows.sum(axis=1, dtype=np.float64) == full).all()


@ASSET
def test_at_morph_weight_zero_it_is_the_base_pose(name):
    if ROWS[name]["morph"] in ("", "0"):
        pytest.skip("the asset has no morph targets")
    tree, binary = files.unpack(ROWS[name]["path"].read_bytes())
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive.pop("targets", None)
    plain = subdivide_gltf(
        files.pack(tree, binary),
        "glb",
        Options(scheme="loop", levels=1, limit=False),
        None,
        Limits(),
    ).glb
    for number, mesh in enumerate(tree["meshes"]):
        for place in range(len(mesh["primitives"])):
            (faces, expected), (own, posed) = (
                files.primitive_of(glb, number, place)
                for glb in (plain, refined(name, 1, "loop").glb)
            )
            for key in expected:
                np.testing.assert_array_equal(posed[key][own], expected[key][faces])


@ASSET
@LEVEL
def test_animated_it_stays_beside_the_original(conformance, name, levels):
    # Loop's surface lies inside the control mesh's hull in every pose of a rig, or nearly so.
    poses = [
        conformance.loaded(name, *setting)["poses"] for setting in ((0, None), (levels, "loop"))
    ]
    for before, after in zip(*poses, strict=True):
        if before[0][0] is None:
            assert after == before
            continue
        (low, high), (new_low, new_high) = np.array(before), np.array(after)
        size = np.linalg.norm(high - low)
        assert (new_low > low - 0.05 * size).all()
        assert (new_high < high + 0.05 * size).all()
        assert np.linalg.norm(new_high - new_low) > 0.4 * size


@ASSET
def test_every_json_value_that_is_no_geometry_stays(name):
    path = ROWS[name]["path"]
    data = path.read_bytes()
    before = files.unpack(data)[0] if path.suffix == ".glb" else json.loads(data)
    after, _ = files.unpack(refined(name, 1).glb)
    assert set(after["asset"].pop("extras")) - set(before["asset"].pop("extras", {})) == {"pns"}
    for key in ("extensionsUsed", "extensionsRequired"):
        kept = [extension for extension in before.get(key, []) if extension not in STORAGE]
        assert after.pop(key, []) in (kept, before.get(key, []))
        before.pop(key, None)
    # Where an image's bytes are is storage too; which image it is, is not.
    for image in (*before.get("images", []), *after.get("images", [])):
        for key in ("uri", "bufferView", "mimeType"):
            image.pop(key, None)
    for old, new in zip(before["meshes"], after["meshes"], strict=True):
        for a, b in zip(old["primitives"], new["primitives"], strict=True):
            # A mesh without normals gets some.
            made = [key for key in b["attributes"] if key in a["attributes"] or key != "NORMAL"]
            assert made == list(a["attributes"])
            assert [list(t) for t in a.get("targets", [])] == [
                list(t) for t in b.get("targets", [])
            ]
            for p in (a, b):
                for key in ("attributes", "indices", "mode", "targets"):
                    p.pop(key, None)
                extensions = p.pop("extensions", {})
                p["extensions"] = {k: v for k, v in extensions.items() if k not in STORAGE}
        assert new == old
    assert {k: v for k, v in after.items() if k not in GEOMETRY} == {
        k: v for k, v in before.items() if k not in GEOMETRY
    }
