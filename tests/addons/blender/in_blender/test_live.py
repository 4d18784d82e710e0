"""Live mode: the base stays editable, and what is shown follows."""

import bpy
import numpy as np
import pytest
from live_scene import WATCH, settle, shown, started
from scene import chosen, cube, evaluated, grid, linked, numbers, points_of, refined


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
    obj = grid(4)
    # Neither can be read, or written, of a mesh that is edited.
    obj.data.uv_layers.new(name="Map")
    obj.vertex_groups.new(name="Group").add([0, 1], 0.5, "REPLACE")
    before = shown(started(obj))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 2))
    settle()
    bpy.ops.object.mode_set(mode="OBJECT")
    settle()
    np.testing.assert_allclose(shown(obj) - before, np.tile([0, 0, 2], (len(before), 1)), atol=1e-5)


def test_an_edit_of_a_shared_mesh_is_followed_whichever_object_is_edited():
    obj = started(grid(4, "B"))
    for name in "AC":
        twin = obj.copy()
        twin.name = name
        bpy.context.scene.collection.objects.link(twin)
    before = shown(obj)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 2))
    settle()
    np.testing.assert_allclose(shown(obj) - before, np.tile([0, 0, 2], (len(before), 1)), atol=1e-5)
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_it_rests_when_an_edit_was_followed(mode):
    obj = started(grid(2))
    bpy.ops.object.mode_set(mode=mode)
    obj.data.update_tag()
    for _ in range(100):
        # As Blender does between two ticks: what a refresh changes is no edit.
        bpy.context.view_layer.update()
        if WATCH.run is not None:
            WATCH.run.finish()
        if WATCH.advance(quiet=0) is None:
            break
    else:
        raise AssertionError("it never rests")
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("pieces", [1, 3, 5, 8])
def test_an_edit_while_it_is_refreshed_is_followed_too(pieces):
    obj = started(grid(8))
    obj.vertex_groups.new(name="Group").add(list(range(80)), 0.5, "REPLACE")
    bpy.context.view_layer.update()
    WATCH.advance(quiet=0)
    for _ in range(pieces):
        WATCH.run.advance(0)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    obj.data.vertices[0].select = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="VERT")
    bpy.ops.object.mode_set(mode="OBJECT")
    settle()
    assert len(evaluated(obj).polygons) == 63 * 16


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


def test_an_appended_copy_stays_out_of_the_scene(tmp_path):
    started(grid(4))
    path = str(tmp_path / "live.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    bpy.ops.wm.append(directory=f"{path}/Object/", filename="Grid")
    settle()
    assert [obj.name for obj in bpy.context.scene.objects] == ["Grid"]
    assert len(evaluated(bpy.data.objects["Grid"]).polygons) == 16 * 16


def test_apply_wants_object_mode():
    obj = started(cube())
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Object Mode"):
        bpy.ops.object.pns_live_apply()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert obj.modifiers


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


def removed_by_hand(obj):
    obj.modifiers.remove(obj.modifiers["PNS Live"])


def applied_by_hand(obj):
    bpy.ops.object.modifier_apply(modifier="PNS Live")


def deleted(obj):
    bpy.ops.object.delete()


@pytest.mark.parametrize("end", [removed_by_hand, applied_by_hand])
def test_what_is_no_more_shown_is_not_told_of(end):
    obj = started(cube())
    assert bpy.ops.object.pns_overlay.poll()
    end(obj)
    assert not bpy.ops.object.pns_overlay.poll()
    assert bpy.ops.object.pns_live_add.poll()


@pytest.mark.parametrize("end", [removed_by_hand, applied_by_hand, deleted])
def test_what_is_no_more_shown_is_not_saved(end, tmp_path):
    end(started(cube()))
    path = str(tmp_path / "live.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    left = [] if end is deleted else ["Cube"]
    assert [block.name for block in (*bpy.data.objects, *bpy.data.meshes)] == left * 2


def test_a_modifier_with_another_name_is_followed():
    obj = started(grid(4))
    obj.modifiers["PNS Live"].name = "Smooth"
    before = shown(obj)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    settle()
    assert np.abs(shown(obj) - before).max() > 0.1
    bpy.ops.object.pns_live_remove()
    assert not obj.modifiers


def test_a_modifier_with_nodes_of_its_user_s_own_is_the_user_s(tmp_path, capfd):
    obj = started(cube())
    nodes = bpy.data.node_groups.new("Mine", "GeometryNodeTree")
    obj.modifiers["PNS Live"].node_group = nodes
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    assert "Traceback" not in capfd.readouterr().err
    assert list(bpy.data.objects) == [obj]
    bpy.ops.object.pns_live_add()
    bpy.ops.object.pns_live_remove()
    assert [modifier.node_group for modifier in obj.modifiers] == [nodes]


def test_an_object_with_the_modifier_of_another_is_live_once_it_is_refreshed():
    obj, other = started(grid(4)), cube("Other")
    chosen(obj)
    other.select_set(True)
    bpy.ops.object.make_links_data(type="MODIFIERS")
    chosen(other)
    bpy.ops.object.pns_live_refresh()
    before = shown(other)
    assert len(evaluated(other).polygons) == 6 * 16
    other.data.vertices[0].co.z += 1
    other.data.update()
    settle()
    assert np.abs(shown(other) - before).max() > 0.1


def test_shape_keys_move_what_is_shown_without_a_refresh():
    obj = grid(4)
    obj.shape_key_add(name="Basis")
    raised = obj.shape_key_add(name='A "key"')
    raised.points[7].co.z += 1
    raised.value = 0
    started(obj)
    below = shown(obj)
    raised.value = 0.5
    obj.data.update()
    keys = refined(obj).data.shape_keys.key_blocks
    offset = numbers(keys[1].points, "co", 3) - numbers(keys[0].points, "co", 3)
    assert offset[7, 2] > 0.4
    np.testing.assert_allclose(shown(obj) - below, 0.5 * offset, atol=1e-6)
    raised.points[7].co.z += 1
    obj.data.update()
    settle()
    np.testing.assert_allclose(shown(obj) - below, offset, atol=1e-6)


def test_renders_have_levels_of_their_own():
    obj = started(grid(4), levels=1, render_levels=3)
    before = shown(obj)
    for name in ("render_init", "render_cancel", "render_init", "render_complete"):
        for handler in getattr(bpy.app.handlers, name):
            handler(bpy.context.scene)
        count = len(evaluated(obj).polygons)
        assert count == 16 * 4 ** (3 if name == "render_init" else 1)
    np.testing.assert_array_equal(shown(obj), before)


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


def test_what_a_linked_object_shows_is_its_files(tmp_path):
    obj = linked(started(cube()), tmp_path / "library.blend")
    assert len(evaluated(obj).polygons) == 6 * 16
    for name in ("refresh", "apply", "remove"):
        with pytest.raises(RuntimeError, match="Linked from another file"):
            getattr(bpy.ops.object, f"pns_live_{name}")()


def test_a_deleted_object_is_forgotten_quietly():
    obj = started(grid(4))
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    bpy.context.view_layer.update()
    bpy.data.objects.remove(obj)
    settle()
    assert WATCH.run is None
