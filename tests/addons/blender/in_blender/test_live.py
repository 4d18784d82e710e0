"""Live mode: the base stays editable, and what is shown follows, by a timer that undo ignores."""

import bpy
import numpy as np
import pytest
from scene import (
    WATCH,
    chosen,
    cube,
    edit,
    evaluated,
    grid,
    linked,
    numbers,
    points_of,
    refined,
    rigged,
    settle,
    shown_here,
    started,
)


def shown(obj):
    """The vertices that are shown."""
    return points_of(evaluated(obj))


def faces(obj):
    """The number of faces that are shown."""
    return len(evaluated(obj).polygons)


def by_name():
    """The object, which undo and files replace."""
    return bpy.data.objects["Grid"]


def in_edit_mode(obj):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 2))
    settle()
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("act", [edit, in_edit_mode])
def test_an_edit_is_followed_by_itself_for_all_that_share_the_mesh(act):
    obj = grid(4)
    # Neither can be read, or written, of a mesh that is edited.
    obj.data.uv_layers.new(name="Map")
    obj.vertex_groups.new(name="Group").add([0, 1], 0.5, "REPLACE")
    twin = shown_here(started(obj).copy())
    np.testing.assert_allclose(shown(obj), points_of(refined(obj).data), atol=1e-6)
    before = shown(obj)
    act(chosen(obj))
    assert len(obj.data.polygons) == 16
    assert np.abs(shown(obj) - before).max() > 0.1
    np.testing.assert_allclose(shown(obj), points_of(refined(obj).data), atol=1e-6)
    np.testing.assert_array_equal(shown(twin), shown(obj))
    result = obj.data.pns_live.cache.data
    obj.update_tag()
    settle()
    assert obj.data.pns_live.cache.data == result, "nothing is refined again without an edit"


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
    assert faces(obj) == 63 * 16


def test_settings_are_followed_on_refresh_and_automatic_refresh_can_be_off():
    obj = started(cube(), levels=3, scheme="LOOP", automatic=False)
    assert faces(obj) == 12 * 64
    before = shown(obj)
    edit(obj)
    np.testing.assert_array_equal(shown(obj), before)
    bpy.ops.object.pns_live_refresh()
    assert np.abs(shown(obj) - before).max() > 0.1


def test_rigs_and_shape_keys_move_what_is_shown_without_a_refresh():
    obj = grid(6)
    rig = rigged(obj, Still=(0, lambda x: (1 - x) / 2), Moving=(1, lambda x: (1 + x) / 2))
    started(obj, scheme="LOOP")
    rest = shown(obj)
    rig.pose.bones["Moving"].location = (0, 2, 0)
    # Weights are linear in x and go by Loop's masks, as points do: what they move is linear too.
    inner = np.abs(rest[:, :2]).max(axis=1) < 0.7
    np.testing.assert_allclose((shown(obj) - rest)[inner, 2], 1 + rest[inner, 0], atol=1e-5)
    assert [m.name for m in obj.modifiers] == ["PNS Live", "Armature"]
    obj = grid(4, "Keyed")
    obj.shape_key_add(name="Basis")
    raised = obj.shape_key_add(name='A "key"')
    raised.points[7].co.z += 1
    raised.value = 0
    below = shown(started(obj))
    raised.value = 0.5
    obj.data.update()
    basis, lifted = (
        numbers(block.points, "co", 3) for block in refined(obj).data.shape_keys.key_blocks
    )
    assert (lifted - basis)[7, 2] > 0.4
    np.testing.assert_allclose(shown(obj) - below, 0.5 * (lifted - basis), atol=1e-6)


def test_it_survives_saving_appending_and_duplication(tmp_path):
    before, path = shown(started(grid(4))), str(tmp_path / "live.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    bpy.ops.wm.append(directory=f"{path}/Object/", filename="Grid")
    settle()
    assert [obj.name for obj in bpy.context.scene.objects] == ["Grid"]
    assert faces(by_name()) == 16 * 16
    bpy.ops.wm.open_mainfile(filepath=path)
    obj = by_name()
    np.testing.assert_array_equal(shown(obj), before)
    twin = obj.copy()
    twin.data = obj.data.copy()
    shown_here(twin)
    np.testing.assert_array_equal(shown(twin), before)
    edit(twin)
    np.testing.assert_array_equal(shown(obj), before)
    assert np.abs(shown(twin) - before).max() > 0.1


def test_renders_have_levels_of_their_own():
    obj = started(grid(4), levels=1, render_levels=3)
    before = shown(obj)
    for name in ("render_init", "render_cancel", "render_init", "render_complete"):
        for handler in getattr(bpy.app.handlers, name):
            handler(bpy.context.scene)
        assert faces(obj) == 16 * 4 ** (3 if name == "render_init" else 1)
    np.testing.assert_array_equal(shown(obj), before)


# --- its end --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("end", "count"), [("apply", 96), ("remove", 6)])
def test_it_ends_without_a_trace(end, count):
    obj = started(cube())
    before = shown(obj)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Object Mode"):
        bpy.ops.object.pns_live_apply()
    bpy.ops.object.mode_set(mode="OBJECT")
    getattr(bpy.ops.object, f"pns_live_{end}")()
    assert (faces(obj), len(obj.data.polygons), obj.data.name) == (count, count, "Cube")
    if end == "apply":
        np.testing.assert_allclose(shown(obj), before, atol=1e-6)
    assert not any((obj.modifiers, obj.data.pns_live.enabled, bpy.data.node_groups))
    assert len(bpy.data.objects) == 1


@pytest.mark.parametrize("keep", [True, False])
def test_what_is_refined_shows_its_own_mesh_and_no_longer_a_live_one(keep):
    obj = started(grid(2))
    bpy.ops.object.pns_overlay(shown="pns_gate")
    new = refined(obj, levels=1, keep_original=keep)
    assert faces(new) == len(new.data.polygons) == 16
    assert not any((new.modifiers, new.data.pns_live.enabled))
    assert faces(obj) == (4 * 16 if keep else 16)
    # The base, its copy's two holders; or the object alone.
    assert len(bpy.data.objects) == (4 if keep else 1)


ENDS = {
    "removed": lambda obj: obj.modifiers.remove(obj.modifiers["PNS Live"]),
    "applied": lambda obj: bpy.ops.object.modifier_apply(modifier="PNS Live"),
    "deleted": lambda obj: bpy.ops.object.delete(),
}


@pytest.mark.parametrize("end", ENDS)
def test_what_is_no_more_shown_is_neither_told_of_nor_saved(end, tmp_path):
    obj = started(cube())
    edit(obj, settled=False)
    assert bpy.ops.object.pns_overlay.poll()
    ENDS[end](obj)
    assert not bpy.ops.object.pns_overlay.poll()
    settle()
    path = str(tmp_path / "live.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    left = [] if end == "deleted" else ["Cube"]
    assert [block.name for block in (*bpy.data.objects, *bpy.data.meshes)] == left * 2


def test_modifiers_are_told_by_their_nodes_and_not_by_their_names(tmp_path):
    obj, other = started(grid(4)), cube("Other")
    obj.modifiers["PNS Live"].name = "Smooth"
    before = shown(obj)
    edit(obj)
    assert np.abs(shown(obj) - before).max() > 0.1
    # One with the modifier of another is live once it is refreshed.
    chosen(obj)
    other.select_set(True)
    bpy.ops.object.make_links_data(type="MODIFIERS")
    chosen(other)
    bpy.ops.object.pns_live_refresh()
    assert faces(other) == 6 * 16
    # What has nodes of its user's own is the user's.
    other.modifiers[0].name = "PNS Live"
    other.modifiers[0].node_group = bpy.data.node_groups.new("Mine", "GeometryNodeTree")
    bpy.ops.object.pns_live_add()
    bpy.ops.object.pns_live_remove()
    assert [modifier.node_group.name for modifier in other.modifiers] == ["Mine"]


def test_what_is_linked_is_refused_in_words(tmp_path):
    obj = linked(started(cube()), tmp_path / "live.blend")
    assert faces(obj) == 6 * 16
    linked(cube(), tmp_path / "plain.blend")
    # An override can be changed, and its mesh cannot, which holds the settings.
    shown_here(bpy.context.object.override_create())
    with pytest.raises(RuntimeError, match="Linked from another file"):
        bpy.ops.object.pns_live_add()
    obj = linked(started(cube("Other")), tmp_path / "other.blend")
    for act in ("refresh", "apply", "remove"):
        with pytest.raises(RuntimeError, match="Linked from another file"):
            getattr(bpy.ops.object, f"pns_live_{act}")()


# --- undo -----------------------------------------------------------------------------------------


def pushed(*acts):
    """Push a step of undo after each act."""
    bpy.context.preferences.edit.use_global_undo = True
    for act in acts:
        act()
        bpy.ops.ed.undo_push(message="step")


def test_undo_frees_nothing_that_is_shown_and_takes_edits_back():
    obj = started(grid(4))
    before = shown(obj)

    def change():
        obj.data.materials.append(bpy.data.materials.new("Young"))
        edit(obj, settled=False)

    # The step is made with the edit, and the refresh comes after it.
    pushed(settle, change)
    settle()
    after = shown(obj)
    for take, expected, materials in (("undo", before, []), ("redo", after, ["Young"])):
        getattr(bpy.ops.ed, take)()
        mesh = by_name().data.pns_live.cache.data
        assert mesh in bpy.data.meshes[:]
        assert all(m is None or m in bpy.data.materials[:] for m in mesh.materials)
        settle()
        np.testing.assert_allclose(shown(by_name()), expected, atol=1e-6)
        assert [m.name for m in evaluated(by_name()).materials] == materials


@pytest.mark.parametrize("pieces", [1, 8, 12])
def test_undo_while_it_is_refreshed_is_followed(pieces):
    obj = started(grid(4))
    before = shown(obj)
    pushed(settle, lambda: edit(obj, settled=False))
    bpy.context.view_layer.update()
    WATCH.advance(quiet=0)
    for _ in range(pieces):
        WATCH.run.advance(0)
    bpy.ops.ed.undo()
    settle()
    np.testing.assert_allclose(shown(by_name()), before, atol=1e-6)
    assert len(bpy.data.meshes) == 3


def test_undo_brings_back_what_was_removed_by_hand_and_saved(tmp_path):
    obj = started(grid(4))
    before = shown(obj)
    pushed(settle, lambda: ENDS["removed"](obj))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    bpy.ops.ed.undo()
    settle()
    np.testing.assert_allclose(shown(by_name()), before, atol=1e-6)


def test_undo_of_a_duplicates_edit_shows_the_common_result_again():
    obj = grid(4)
    obj.data.materials.append(bpy.data.materials.new("Own"))
    before = shown(started(obj))
    bpy.ops.object.duplicate()
    twin = bpy.context.object
    pushed(settle, lambda: edit(twin, settled=False))
    settle()
    # Undo counts the users of what is kept, dead or alive, before it tells that it is done.
    for handler in bpy.app.handlers.undo_pre:
        handler(bpy.context.scene)
    assert twin.modifiers[0].node_group is twin.data.pns_live.cache is None
    assert list(obj.data.pns_live.cache.data.materials) == [None]
    bpy.ops.ed.undo()
    settle()
    np.testing.assert_allclose(shown(bpy.data.objects["Grid.001"]), before, atol=1e-6)
