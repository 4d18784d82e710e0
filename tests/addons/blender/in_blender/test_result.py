"""The operator's positions, on the object that was asked for."""

import bpy
import numpy as np
import pytest
from scene import (
    chosen,
    cube,
    evaluated,
    grid,
    linked,
    placed,
    points_of,
    refined,
    triangles_of,
)

import pns_common


@pytest.mark.parametrize("scheme", ["PNS", "LOOP"])
def test_positions_are_those_of_the_operator(scheme):
    obj = grid(9)
    quads = [list(p.vertices) for p in obj.data.polygons]
    faces = triangles_of(obj.data) if scheme == "LOOP" else quads
    mesh = pns_common.Mesh(points_of(obj.data), faces)
    rule = pns_common.loop() if scheme == "LOOP" else pns_common.pns(pns_common.load_model())
    expected = pns_common.refine(mesh, rule, 2).mesh.vertices
    points = points_of(refined(obj, levels=2, scheme=scheme).data)
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_the_budget_is_passed_on():
    obj = grid(5)
    mesh = pns_common.Mesh(points_of(obj.data), [list(p.vertices) for p in obj.data.polygons])
    plain = pns_common.refine(mesh, "catmull-clark", 2).mesh.vertices
    np.testing.assert_allclose(points_of(refined(obj, budget=0.0).data), plain, atol=1e-6)
    assert np.abs(points_of(refined(obj).data) - plain).max() > 1e-6


def test_the_limit_surface_is_reached():
    obj = grid(5)
    at_limit = points_of(refined(obj, levels=1, limit=True, scheme="LOOP").data)
    deep = points_of(refined(obj, levels=6, scheme="LOOP").data)
    np.testing.assert_allclose(at_limit, deep[: len(at_limit)], atol=2e-4)


def test_keeping_the_original_leaves_it_as_it_was():
    obj = cube()
    before = points_of(obj.data)
    new = refined(obj)
    assert new.data != obj.data
    np.testing.assert_array_equal(points_of(obj.data), before)


def test_the_result_stands_beside_its_original():
    obj = cube()
    obj.scale.x = 3
    bpy.context.view_layer.update()
    assert refined(obj).location.x == pytest.approx(6.6)
    assert refined(obj, beside=False).location.x == 0
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    obj.modifiers.new("Rig", "ARMATURE").object = rig
    assert refined(obj).location.x == 0


def test_a_subdivision_surface_is_switched_off_where_that_is_asked_for():
    obj = cube()
    obj.modifiers.new("Rounder", "SUBSURF")
    new = refined(obj, levels=1)
    assert len(evaluated(new).polygons) == 24 * 4
    assert bpy.ops.object.pns_subsurf_off() == {"FINISHED"}
    assert len(evaluated(new).polygons) == 24
    assert not bpy.ops.object.pns_subsurf_off.poll()
    assert obj.modifiers["Rounder"].show_viewport


def test_without_the_original_the_object_stays_itself():
    obj = cube()
    assert refined(obj, keep_original=False, levels=1) == obj
    assert len(obj.data.polygons) == 24
    assert len(bpy.data.objects) == 1


def test_without_the_original_its_mesh_is_called_as_before():
    """Exporters write the names of meshes, not of objects alone."""
    obj = cube()
    obj.data.name = "Held"
    assert refined(obj, keep_original=False, levels=1).data.name == "Held"
    # Its name stays with whoever still shows it.
    twin = obj.copy()
    bpy.context.scene.collection.objects.link(twin)
    twin.select_set(False)
    assert refined(obj, keep_original=False, levels=1).data.name != "Held"
    assert twin.data.name == "Held"
    kept = twin.data
    kept.use_fake_user = True
    refined(twin, keep_original=False, levels=1)
    assert kept.name == "Held"


def test_a_linked_object_is_copied_and_never_changed(tmp_path):
    obj = linked(cube(), tmp_path / "library.blend")
    with pytest.raises(RuntimeError, match=r"Linked from another file.*Cube.*Keep Original"):
        bpy.ops.object.pns_refine(keep_original=False)
    assert len(obj.data.polygons) == 6
    new = refined(obj, levels=1)
    assert new.library is None
    assert (len(obj.data.polygons), len(new.data.polygons)) == (6, 24)


def test_a_linked_object_is_told_from_one_of_the_same_name(tmp_path):
    """A grid here, and a cube that is linked under its name: each is refined, and no other."""
    there = linked(cube(), tmp_path / "library.blend")
    here = grid(2, there.name)
    assert (here.name, here.data.name) == (there.name, there.data.name)
    chosen(there)
    bpy.ops.object.pns_refine(levels=1)
    assert len(bpy.context.object.data.polygons) == 24
    chosen(here)
    there.select_set(True)
    bpy.ops.object.pns_refine(levels=1)
    made = [len(obj.data.polygons) for obj in bpy.context.selected_objects]
    assert sorted(made) == [16, 24]


def test_a_copy_of_what_lies_in_a_linked_collection_lies_in_the_scene(tmp_path):
    own = bpy.data.collections.new("Own")
    own.objects.link(cube())
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {own})
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Own"]
    bpy.context.scene.collection.children.link(bpy.data.collections["Own"])
    new = refined(bpy.data.objects["Cube"], levels=1)
    assert new.users_collection == (bpy.context.scene.collection,)


def test_a_linked_mesh_of_an_object_here_can_be_replaced(tmp_path):
    linked(cube(), tmp_path / "library.blend")
    obj = bpy.context.object.make_local()
    chosen(obj)
    there = obj.data
    assert there.library is not None
    assert refined(obj, levels=1, keep_original=False).data.library is None
    assert there.name == "Cube"


@pytest.mark.parametrize("keep", [True, False])
def test_what_is_refined_shows_its_own_mesh_and_no_longer_a_live_one(keep):
    obj = grid(2)
    bpy.ops.object.pns_live_add()
    bpy.ops.object.pns_overlay(shown="pns_gate")
    new = refined(obj, levels=1, keep_original=keep)
    assert len(evaluated(new).polygons) == len(new.data.polygons) == 16
    assert not new.modifiers
    assert not new.data.pns_live.enabled
    assert len(evaluated(obj).polygons) == (4 * 16 if keep else 16)
    # The base, its copy's two holders; or the object alone.
    assert len(bpy.data.objects) == (4 if keep else 1)


def test_an_error_names_the_object():
    good, bad = cube("Good"), cube("Bad")
    bad.data.vertices[0].co.x = float("nan")
    good.select_set(True)
    with pytest.raises(RuntimeError, match="Bad: vertex 0"):
        bpy.ops.object.pns_refine()
    assert len(bpy.data.meshes) == 2


def test_a_model_file_may_be_named_from_the_files_folder(tmp_path):
    cube()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    with pytest.raises(RuntimeError, match=str(tmp_path / "none.onnx")):
        bpy.ops.object.pns_refine(model_file="//none.onnx")


def test_of_several_the_copy_of_the_active_one_is_active():
    objects = [cube("first"), grid(2, "second"), grid(3, "third")]
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = objects[1]
    assert bpy.ops.object.pns_refine() == {"FINISHED"}
    assert bpy.context.object.name == "second refined"
    assert len(bpy.context.selected_objects) == 3


def test_objects_that_share_a_mesh_share_the_result():
    obj = cube()
    twin = obj.copy()
    bpy.context.scene.collection.objects.link(twin)
    chosen(obj)
    twin.select_set(True)
    bpy.ops.object.pns_refine(keep_original=False)
    assert obj.data == twin.data
    assert len(obj.data.polygons) == 96


def test_detail_makes_faces_where_the_surface_bends():
    obj = grid(9)
    with pytest.raises(RuntimeError, match="triangulate it"):
        refined(obj, detail="FACES", max_faces=1000)
    points, faces = points_of(obj.data), triangles_of(obj.data)
    obj = placed("Triangles", points.tolist(), [list(map(int, face)) for face in faces])
    expected = pns_common.refine(
        pns_common.Mesh(points, faces), pns_common.loop(), max_faces=1000, creases=None
    )
    made = refined(obj, detail="FACES", max_faces=1000, scheme="LOOP").data
    np.testing.assert_allclose(points_of(made), expected.mesh.vertices, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(triangles_of(made), expected.mesh.faces)
    assert 900 < len(made.polygons) <= 1000
    near = refined(obj, detail="TOLERANCE", tolerance=0.05).data
    assert "adaptive" in near.pns_result.report
