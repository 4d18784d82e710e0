"""Live mode and undo, whose steps know nothing of what a timer does."""

import bpy
import numpy as np
import pytest
from bl_ext.user_default.pns_refine.live_watch import after_undo, before_undo
from live_scene import WATCH, settle, shown, shown_mesh, started
from scene import evaluated, grid


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


def test_undo_frees_nothing_that_is_shown():
    bpy.context.preferences.edit.use_global_undo = True
    obj = started(grid(4))
    bpy.ops.ed.undo_push(message="live")
    before = shown(obj)
    obj.data.materials.append(bpy.data.materials.new("Young"))
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    # The step is made with the edit, and the refresh comes after it.
    bpy.ops.ed.undo_push(message="edit")
    settle()
    after = shown(obj)
    for take, expected, materials in (("undo", before, []), ("redo", after, ["Young"])):
        getattr(bpy.ops.ed, take)()
        obj = bpy.data.objects["Grid"]
        assert shown_mesh(obj) in bpy.data.meshes[:]
        assert all(m is None or m in bpy.data.materials[:] for m in shown_mesh(obj).materials)
        settle()
        np.testing.assert_allclose(shown(obj), expected, atol=1e-6)
        assert [m.name for m in evaluated(obj).materials] == materials


@pytest.mark.parametrize("pieces", [1, 8, 12])
def test_undo_while_it_is_refreshed_is_followed(pieces):
    bpy.context.preferences.edit.use_global_undo = True
    obj = started(grid(4))
    settle()
    bpy.ops.ed.undo_push(message="live")
    before = shown(obj)
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="edit")
    WATCH.advance(quiet=0)
    for _ in range(pieces):
        WATCH.run.advance(0)
    bpy.ops.ed.undo()
    settle()
    np.testing.assert_allclose(shown(bpy.data.objects["Grid"]), before, atol=1e-6)
    assert len(bpy.data.meshes) == 3


def test_undo_of_a_removal_by_hand_that_was_saved_shows_the_result_again(tmp_path):
    bpy.context.preferences.edit.use_global_undo = True
    obj = started(grid(4))
    before = shown(obj)
    bpy.ops.ed.undo_push(message="live")
    obj.modifiers.remove(obj.modifiers["PNS Live"])
    bpy.ops.ed.undo_push(message="removed")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    bpy.ops.ed.undo()
    settle()
    np.testing.assert_allclose(shown(bpy.data.objects["Grid"]), before, atol=1e-6)


def test_before_undo_nothing_refers_to_what_it_may_free():
    obj = started(grid(4))
    bpy.ops.object.duplicate()
    twin = bpy.context.object
    twin.data.materials.append(bpy.data.materials.new("Young"))
    twin.data.update()
    settle()
    after = shown(twin)
    (modifier,) = twin.modifiers
    assert twin.data.pns_live.cache != obj.data.pns_live.cache
    before_undo()
    # Undo counts the users of what is kept, dead or alive, before it tells that it is done.
    assert modifier.node_group is None
    assert twin.data.pns_live.cache is None
    assert not any(any(m.materials) for m in bpy.data.meshes if m != twin.data)
    assert shown_mesh(obj)
    after_undo()
    settle()
    np.testing.assert_array_equal(shown(twin), after)
    assert [m.name for m in evaluated(twin).materials] == ["Young"]
    before_undo()
    obj.data.materials.append(bpy.data.materials["Young"])
    settle()
    before_undo()
    assert list(shown_mesh(obj).materials) == [None]
    after_undo()
    assert [m.name for m in shown_mesh(obj).materials] == ["Young"]


def test_undo_of_a_duplicates_edit_shows_the_common_result_again():
    bpy.context.preferences.edit.use_global_undo = True
    before = shown(started(grid(4)))
    bpy.ops.object.duplicate()
    settle()
    bpy.ops.ed.undo_push(message="twin")
    twin = bpy.context.object
    twin.data.vertices[7].co.z += 1
    twin.data.update()
    bpy.ops.ed.undo_push(message="edit")
    settle()
    bpy.ops.ed.undo()
    settle()
    np.testing.assert_allclose(shown(bpy.data.objects["Grid.001"]), before, atol=1e-6)
