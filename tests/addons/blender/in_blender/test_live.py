"""Live mode: the base stays editable, and what is shown follows."""

import bl_ext.user_default.pns_refine.live as live
import bpy
import numpy as np
import pytest
from scene import chosen, cube, evaluated, grid, linked, points_of, refined


def started(obj, **settings):
    """The object, live, with these settings."""
    chosen(obj)
    assert bpy.ops.object.pns_live_add() == {"FINISHED"}
    for name, value in settings.items():
        setattr(obj.data.pns_live, name, value)
    if settings:
        bpy.ops.object.pns_live_refresh()
    return obj


def shown(obj):
    """The vertices that are shown."""
    return points_of(evaluated(obj))


def settle():
    """What Blender's timer does in the seconds after an edit, at once."""
    bpy.context.view_layer.update()
    for _ in range(100):
        if live.WATCH.run is not None:
            live.WATCH.run.finish()
        if live.WATCH.advance(quiet=0) is None:
            return
    raise AssertionError("it never settles")


def test_the_result_is_shown_and_the_base_is_kept():
    obj = started(grid(4))
    assert len(obj.data.polygons) == 16
    np.testing.assert_allclose(shown(obj), points_of(refined(grid(4, "Other")).data), atol=1e-6)


def test_an_edit_is_followed_by_itself():
    obj = started(grid(4))
    before = shown(obj)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    settle()
    assert np.abs(shown(obj) - before).max() > 0.1
    expected = grid(4, "Other")
    expected.data.vertices[7].co.z += 1
    np.testing.assert_allclose(shown(obj), points_of(refined(expected).data), atol=1e-6)


def test_an_edit_in_edit_mode_is_followed():
    obj = started(grid(4))
    before = shown(obj)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 2))
    settle()
    bpy.ops.object.mode_set(mode="OBJECT")
    settle()
    np.testing.assert_allclose(shown(obj) - before, np.tile([0, 0, 2], (len(before), 1)), atol=1e-5)


def test_nothing_is_refined_again_without_an_edit():
    obj = started(grid(4))
    result = obj.data.pns_live.cache.data
    obj.update_tag()
    obj.data.update()
    settle()
    bpy.ops.object.pns_live_refresh()
    assert obj.data.pns_live.cache.data == result


def test_automatic_refresh_can_be_off():
    obj = started(grid(4))
    obj.data.pns_live.automatic = False
    before = shown(obj)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    settle()
    np.testing.assert_array_equal(shown(obj), before)
    bpy.ops.object.pns_live_refresh()
    assert np.abs(shown(obj) - before).max() > 0.1


def test_settings_are_followed_on_refresh():
    obj = started(cube(), levels=3, scheme="LOOP")
    assert len(evaluated(obj).polygons) == 12 * 64


def test_an_armature_bends_what_is_shown():
    obj = grid(6)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    chosen(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    for name, x in (("Still", 0), ("Moving", 1)):
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (x, 0, 0), (x, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    for name, sign in (("Still", -1), ("Moving", 1)):
        group = obj.vertex_groups.new(name=name)
        for vertex in obj.data.vertices:
            group.add([vertex.index], (1 + sign * vertex.co.x) / 2, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    started(obj, scheme="LOOP")
    rest = shown(obj)
    rig.pose.bones["Moving"].location = (0, 2, 0)
    bpy.context.view_layer.update()
    moved = shown(obj) - rest
    # Weights are linear in x and go by Loop's masks, as points do: what they move is linear too.
    inner = np.abs(rest[:, :2]).max(axis=1) < 0.7
    np.testing.assert_allclose(moved[inner, 2], 1 + rest[inner, 0], atol=1e-5)
    assert [m.name for m in obj.modifiers] == ["PNS Live", "Armature"]


def test_it_survives_saving_and_opening_again(tmp_path):
    before = shown(started(grid(4)))
    path = str(tmp_path / "live.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    obj = bpy.data.objects["Grid"]
    np.testing.assert_array_equal(shown(obj), before)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    settle()
    assert np.abs(shown(obj) - before).max() > 0.1


def test_a_duplicate_gets_a_result_of_its_own():
    obj = started(grid(4))
    before = shown(obj)
    twin = obj.copy()
    twin.data = obj.data.copy()
    bpy.context.scene.collection.objects.link(twin)
    np.testing.assert_array_equal(shown(twin), before)
    twin.data.vertices[7].co.z += 1
    twin.data.update()
    settle()
    np.testing.assert_array_equal(shown(obj), before)
    assert np.abs(shown(twin) - before).max() > 0.1
    assert twin.data.pns_live.cache != obj.data.pns_live.cache


def test_linked_data_shares_the_result():
    obj = started(grid(4))
    twin = obj.copy()
    bpy.context.scene.collection.objects.link(twin)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    settle()
    np.testing.assert_array_equal(shown(twin), shown(obj))


def test_undo_takes_back_an_edit_and_its_result():
    bpy.context.preferences.edit.use_global_undo = True
    obj = started(grid(4))
    bpy.ops.ed.undo_push(message="live")
    before = shown(obj)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    settle()
    bpy.ops.ed.undo_push(message="edit")
    bpy.ops.ed.undo()
    obj = bpy.data.objects["Grid"]
    settle()
    np.testing.assert_allclose(shown(obj), before, atol=1e-6)


def test_apply_gives_the_result_for_good():
    obj = started(cube())
    before = shown(obj)
    bpy.ops.object.pns_live_apply()
    assert not obj.modifiers
    np.testing.assert_allclose(points_of(obj.data), before, atol=1e-6)
    assert not obj.data.pns_live.enabled
    assert obj.data.name == "Cube"
    assert len(bpy.data.objects) == 1
    assert not bpy.data.node_groups


def test_remove_leaves_the_base():
    obj = started(cube())
    bpy.ops.object.pns_live_remove()
    assert len(evaluated(obj).polygons) == 6
    assert not obj.modifiers
    assert len(bpy.data.objects) == len(bpy.data.meshes) == 1
    assert not bpy.data.node_groups


def test_shape_keys_are_refused_in_words():
    obj = cube()
    obj.shape_key_add(name="Basis")
    with pytest.raises(RuntimeError, match="shape keys need one each"):
        bpy.ops.object.pns_live_add()


def test_a_linked_object_is_refused_in_words(tmp_path):
    obj = linked(cube(), tmp_path / "library.blend")
    with pytest.raises(RuntimeError, match="Linked from another file"):
        bpy.ops.object.pns_live_add()
    # An override can be changed, and its mesh cannot, which holds the settings.
    override = obj.override_create()
    bpy.context.scene.collection.objects.link(override)
    chosen(override)
    with pytest.raises(RuntimeError, match="Linked from another file"):
        bpy.ops.object.pns_live_add()


def test_a_deleted_object_is_forgotten_quietly():
    obj = started(grid(4))
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    bpy.context.view_layer.update()
    bpy.data.objects.remove(obj)
    settle()
    assert live.WATCH.run is None
