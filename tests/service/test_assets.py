"""Every glTF asset of the shared collection, with the outcome that is expected of it."""

import numpy as np
import pytest
import trimesh

from pns_common.mesh.topology import EdgeClass, build_topology
from service.bodies.sibling_files import folder_of
from service.errors import ServiceError
from service.gltf.subdivide import subdivide_gltf
from service.meshes.weld import weld
from service.options import Limits, Options
from tests.support.gltf import files, validator
from tests.support.networks import random_model
from tests.support.shared import shared_path

# Faces of all meshes before refinement, and of these the degenerate ones.
REFINED = {
    "alien.glb": (292, 0),
    "barrel_large_decorated.glb": (1047, 0),
    "cakeBirthday.glb": (1332, 0),
    "cow.glb": (5856, 0),
    "low-poly-tree.glb": (1126, 0),
    "fixtures/BoxInterleaved.glb": (12, 0),
    "fixtures/BoxVertexColors.glb": (12, 0),
    "fixtures/gltf_extras.glb": (12, 0),
    "fixtures/gltf_primitives.glb": (12, 0),
    "fixtures/simple-instancing.glb": (12, 0),
}
# The same of files that are stored in other ways, skinned or morphed.
ENCODED = {
    "AnimatedMorphSphere.glb": (960, 0),
    "Fox.glb": (576, 0),
    "Knight.glb": (6952, 0),
    "MorphStressTest.glb": (2412, 0),
    "RiggedFigure.glb": (256, 0),
    "frostAxe.glb": (2016, 0),
    "fixtures/10_custom_normals/10_custom_normals.gltf": (88, 0),
    "fixtures/18_variants/18_variants.gltf": (12, 0),
    "fixtures/BoxDraco/BoxDraco.gltf": (12, 0),
    "fixtures/BoxMeshopt.glb": (12, 0),
    "fixtures/MultiUVTest/MultiUVTest.gltf": (12, 0),
    "fixtures/SimpleSparseAccessor.gltf": (12, 0),
    "fixtures/mode5_strip.gltf": (2786, 0),
    "fixtures/simple_skin.gltf": (8, 0),
    "fixtures/singleBlendshapeCube_sparse.glb": (12, 0),
}
ALL = {**REFINED, **ENCODED}
WRONG = {
    "fixtures/IndexOutOfRange/IndexOutOfRange.gltf": ("invalid-gltf", "/accessors/0"),
    "fixtures/BoxWithInfinites.glb": ("invalid-gltf", "/accessors/2"),
    "fixtures/empty_nodes.glb": ("unrefinable-mesh", "/meshes"),
}


def refine_asset(name, **options):
    path = shared_path(f"assets/{name}")
    media = "glb" if name.endswith(".glb") else "gltf"
    return subdivide_gltf(
        path.read_bytes(),
        media,
        Options(**options),
        random_model(0),
        Limits(),
        siblings=folder_of(path),
    )


def test_every_asset_has_an_expected_outcome():
    folder = shared_path("assets")
    listed = {
        str(p.relative_to(folder)) for p in folder.rglob("*") if p.suffix in (".glb", ".gltf")
    }
    assert listed == {*ALL, *WRONG}


@pytest.mark.parametrize("name", ALL)
def test_faces_are_four_a_level(name):
    (faces, degenerate), levels = ALL[name], 2
    report = refine_asset(name, levels=levels).report
    assert report["totals"]["faces"] == (faces - degenerate) * 4**levels
    assert report["dropped"]["degenerate_faces"] == degenerate
    assert [level["faces"] for level in report["levels"]] == [
        (faces - degenerate - report["totals"]["copied_faces"]) * 4**level
        for level in range(1, levels + 1)
    ]


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_refused_with_a_pointer(name):
    with pytest.raises(ServiceError) as refusal:
        refine_asset(name)
    assert (refusal.value.code, refusal.value.pointer) == WRONG[name]


def test_validator_finds_no_new_error(tmp_path):
    """With all diagnostics and with none; with a summary it is tests/conformance's to look."""
    paths = [shared_path(f"assets/{name}") for name in ALL]
    for diagnostics in ("full", "none"):
        for name in ALL:
            paths.append(tmp_path / f"{len(paths)}.glb")
            paths[-1].write_bytes(refine_asset(name, levels=1, diagnostics=diagnostics).glb)
    found = [set(codes) for codes in validator.errors(paths)]
    count = len(ALL)
    for name, before, *after in zip(
        ALL, found[:count], found[count : 2 * count], found[2 * count :], strict=True
    ):
        assert all(codes <= before for codes in after), name


def welded_meshes(data):
    """For each mesh of a GLB its triangles, joined by position."""
    tree, binary = files.unpack(data)
    for mesh in tree["meshes"]:
        points, faces = [], []
        for primitive in mesh["primitives"]:
            position = files.values_of(tree, binary, primitive["attributes"]["POSITION"])
            indices = files.values_of(tree, binary, primitive["indices"]).astype(np.int64)
            faces.append(indices.reshape(-1, 3) + sum(map(len, points)))
            points.append(position)
        yield weld(np.concatenate(points), np.concatenate(faces))


def open_edges(data):
    """For each mesh of a GLB the number of edges that are not interior."""
    counts = []
    for mesh in welded_meshes(data):
        topology = build_topology(mesh.faces, len(mesh.points))
        counts.append(int((topology.edge_class == EdgeClass.BOUNDARY).sum()))
    return counts


@pytest.mark.parametrize("name", REFINED)
def test_seams_do_not_crack(name):
    # Watertight meshes stay watertight, and open ones get nothing but their own rims halved.
    before = open_edges(shared_path(f"assets/{name}").read_bytes())
    after = open_edges(refine_asset(name, levels=1).glb)
    assert after == [2 * count for count in before]


@pytest.mark.parametrize("name", ["cow.glb", "low-poly-tree.glb", "fixtures/BoxInterleaved.glb"])
def test_loop_equals_another_implementation_on_closed_assets(name):
    (control,) = welded_meshes(shared_path(f"assets/{name}").read_bytes())
    (refined,) = welded_meshes(refine_asset(name, scheme="loop", levels=1, limit=False).glb)
    points, faces = trimesh.remesh.subdivide_loop(control.points, control.faces, iterations=1)
    expected = points.astype(np.float32)[faces.reshape(-1)]
    # The orders of faces differ: compare the faces' centres as sorted lists.
    assert len(expected) == refined.faces.size
    ours, theirs = (
        np.sort(p.reshape(-1, 3, 3).mean(axis=1), axis=0)
        for p in (refined.points[refined.faces], points[faces])
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-6 * np.abs(points).max())


@pytest.mark.parametrize("name", REFINED)
def test_every_json_value_that_is_no_geometry_stays(name):
    before, _ = files.unpack(shared_path(f"assets/{name}").read_bytes())
    after, _ = files.unpack(refine_asset(name, normals="keep").glb)
    for old, new in zip(before["meshes"], after["meshes"], strict=True):
        for old_primitive, new_primitive in zip(old["primitives"], new["primitives"], strict=True):
            assert list(old_primitive["attributes"]) == list(new_primitive.pop("attributes"))
            del old_primitive["attributes"], new_primitive["indices"]
            old_primitive.pop("indices", None)
    assert set(after["asset"]["extras"]) - set(before["asset"].get("extras", {})) == {"pns"}
    del after["asset"]["extras"]["pns"]
    before["asset"].setdefault("extras", {})
    for key in ("accessors", "bufferViews", "buffers"):
        del before[key], after[key]
    assert after == before


@pytest.mark.parametrize("name", ["alien.glb", "cow.glb"])
def test_the_same_input_gives_the_same_bytes(name):
    assert refine_asset(name, diagnostics="full").glb == refine_asset(name, diagnostics="full").glb
