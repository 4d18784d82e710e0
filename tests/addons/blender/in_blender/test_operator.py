"""The operator, at once and beside the interface: which object has the result, and what is said."""

import sys
import threading
from types import SimpleNamespace

import bl_ext.user_default.pns_refine.operator as operator
import bpy
import numpy as np
import onnxruntime
import pytest
from bl_ext.user_default.pns_refine.refining.job import StoppedError
from conftest import HOME, NAME
from scene import (
    chosen,
    cube,
    evaluated,
    grid,
    linked,
    numbers,
    points_of,
    refined,
    shown_here,
)

import pns_common

GENERAL = pns_common.pns(pns_common.load_model())
FACES, NEAR = {"detail": "FACES", "max_faces": 1000}, {"detail": "TOLERANCE", "tolerance": 0.5}
TURNED = {"detail": "ANGLE", "angle": np.radians(20)}


@pytest.mark.parametrize(
    ("settings", "scheme", "expected"),
    [
        ({}, GENERAL, {}),
        ({"budget": 0.0}, pns_common.pns(pns_common.load_model(), 0.0), {}),
        ({"limit": False}, GENERAL, {"limit": False}),
        ({"crease_angle": 0.2, "levels": 1}, GENERAL, {"levels": 1, "creases": 0.2}),
        ({"scheme": "LOOP"}, "loop", {}),
        (FACES, GENERAL, {"max_faces": 1000, "levels": None}),
        (NEAR, GENERAL, {"tolerance": "0.5%", "levels": None}),
        (FACES | {"scheme": "LOOP"}, "loop", {"max_faces": 1000, "levels": None, "creases": None}),
        (NEAR | {"scheme": "LOOP"}, "loop", {"tolerance": "0.5%", "levels": None, "creases": None}),
        (TURNED | {"scheme": "LOOP"}, "loop", {"angle": 20, "levels": None, "creases": None}),
    ],
)
def test_positions_are_those_of_the_library(settings, scheme, expected):
    """Of quads, for Loop of their triangles."""
    obj = grid(9)
    mesh, faces = obj.data, [list(p.vertices) for p in obj.data.polygons]
    if scheme == "loop":
        mesh.calc_loop_triangles()
        faces = numbers(mesh.loop_triangles, "vertices", 3).astype(int).tolist()
    control = pns_common.Mesh(points_of(mesh), faces)
    if expected.get("creases"):
        bent = pns_common.sharp_edges(control, np.degrees(expected["creases"]))
        expected = expected | {"creases": pns_common.Creases(bent, learned=True, levels=6)}
    made = refined(obj, **settings).data
    points = pns_common.refine(control, scheme, **{"levels": 2} | expected).mesh.vertices
    np.testing.assert_allclose(points_of(made), points, rtol=0, atol=1e-6)
    assert ("adaptive" in made.pns_result.report) == ("detail" in settings)


def test_an_angle_is_refused_for_quads():
    with pytest.raises(RuntimeError, match=r"Angle is for triangles.*Tolerance.*Ctrl T"):
        refined(cube(), **TURNED)


def test_the_original_stays_with_the_result_beside_it_or_gets_it():
    obj = cube()
    before, obj.scale.x, obj.data.name = points_of(obj.data), 3, "Held"
    bpy.context.view_layer.update()
    assert refined(obj).location.x == pytest.approx(6.6)
    assert refined(obj, beside=False).location.x == 0
    np.testing.assert_array_equal(points_of(obj.data), before)
    obj.modifiers.new("Rig", "ARMATURE").object = bpy.data.objects.new(
        "Rig", bpy.data.armatures.new("Rig")
    )
    assert refined(obj).location.x == 0
    # Exporters write the names of meshes, which stay with whoever still shows them.
    twin = obj.copy()
    bpy.context.scene.collection.objects.link(twin)
    assert refined(obj, keep_original=False, levels=1) == obj
    assert (len(obj.data.polygons), twin.data.name) == (24, "Held")
    assert refined(twin, keep_original=False, levels=1).data.name == "Held"


def test_several_are_refined_at_once_and_share_what_they_shared():
    first, second = cube("first"), grid(2, "second")
    twin = shown_here(first.copy())
    for obj in (first, twin, second):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = second
    assert bpy.ops.object.pns_refine(levels=1) == {"FINISHED"}
    assert bpy.context.object.name == "second refined"
    made = {obj.data for obj in bpy.context.selected_objects}
    assert sorted(len(mesh.polygons) for mesh in made) == [16, 24]
    assert len(bpy.context.selected_objects) == 3


def test_a_subdivision_surface_is_switched_off_where_that_is_asked_for():
    obj = cube()
    obj.modifiers.new("Rounder", "SUBSURF")
    new = refined(obj, levels=1)
    assert len(evaluated(new).polygons) == 24 * 4
    assert bpy.ops.object.pns_subsurf_off() == {"FINISHED"}
    assert len(evaluated(new).polygons) == 24
    assert not bpy.ops.object.pns_subsurf_off.poll()
    assert obj.modifiers["Rounder"].show_viewport


def test_what_is_linked_is_copied_and_never_changed(tmp_path):
    """A cube that is linked, and a grid here of its name: each is refined, and no other."""
    there = linked(cube(), tmp_path / "library.blend")
    here = grid(2, there.name)
    assert (here.name, here.data.name) == (there.name, there.data.name)
    chosen(there)
    with pytest.raises(RuntimeError, match=r"Linked from another file.*Cube.*Keep Original"):
        bpy.ops.object.pns_refine(keep_original=False)
    here.select_set(True)
    bpy.ops.object.pns_refine(levels=1)
    made = bpy.context.selected_objects
    assert sorted(len(obj.data.polygons) for obj in made) == [16, 24]
    assert all(obj.library is None for obj in made)
    assert len(there.data.polygons) == 6
    # A linked mesh of an object that is not linked can be replaced.
    local = chosen(there.make_local())
    assert local.data.library is not None
    assert refined(local, levels=1, keep_original=False).data.library is None


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


def test_errors_name_the_object_and_the_file(tmp_path):
    good, bad = cube("Good"), cube("Bad")
    bad.data.vertices[0].co.x = float("nan")
    good.select_set(True)
    with pytest.raises(RuntimeError, match="Bad: vertex 0"):
        bpy.ops.object.pns_refine()
    assert len(bpy.data.meshes) == 2
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    with pytest.raises(RuntimeError, match=str(tmp_path / "none.onnx")):
        bpy.ops.object.pns_refine(model_file="//none.onnx")


@pytest.mark.parametrize("keep", [True, False])
def test_undo_takes_the_result_back(keep):
    bpy.context.preferences.edit.use_global_undo = True
    cube()
    bpy.ops.ed.undo_push(message="cube")
    refined(bpy.context.object, keep_original=keep)
    bpy.ops.ed.undo_push(message="refined")
    bpy.ops.ed.undo()
    assert [obj.name for obj in bpy.data.objects] == ["Cube"]
    assert len(bpy.data.objects["Cube"].data.polygons) == 6
    bpy.ops.ed.redo()
    assert len(bpy.data.objects) == 1 + keep


# --- beside the interface -------------------------------------------------------------------------


class Large(operator.Refining):
    """The operator as Blender would hold it: its settings, and somewhere to report to."""

    def __init__(self, **settings):
        self.said, self.keep_original, self.beside = [], True, True
        defaults = bpy.context.object.data.pns_live
        for name in operator.Settings.__annotations__:
            setattr(self, name, settings.get(name, getattr(defaults, name)))

    def report(self, kind, text):
        self.said.append(text)

    large = operator.OBJECT_OT_pns_refine_large
    invoke, modal, end, cancel = large.invoke, large.modal, large.end, large.cancel


class Context:
    """A context that counts timers and notes the status line."""

    def __init__(self):
        self.status, self.timers, self.window = [], 0, None
        self.window_manager = SimpleNamespace(
            event_timer_add=lambda step, window: self.count(1),
            event_timer_remove=lambda timer: self.count(-1),
            modal_handler_add=lambda run: None,
        )
        self.workspace = SimpleNamespace(status_text_set=self.status.append)

    def __getattr__(self, name):
        return getattr(bpy.context, name)

    def count(self, more):
        self.timers += more

    @property
    def left(self):
        """Timers and status line: none when a run has ended."""
        return self.timers, self.status[-1]


def begun(obj, **settings):
    """The run that the operator begins on an object, and its context."""
    chosen(obj)
    context, run = Context(), Large(**settings)
    assert run.invoke(context, SimpleNamespace(type="LEFTMOUSE")) == {"RUNNING_MODAL"}
    return context, run


def sent(context, run, kind):
    return run.modal(context, SimpleNamespace(type=kind))


def computations():
    """The threads that compute for the operator now."""
    return [thread for thread in threading.enumerate() if thread.name == "pns-refine"]


def driven(context, run):
    """Tick until it ends, each tick after what computes has ended; how it ended."""
    while (answer := sent(context, run, "TIMER")) & {"PASS_THROUGH", "RUNNING_MODAL"}:
        for thread in computations():
            thread.join()
    return answer


def blocks():
    return set(bpy.data.objects), set(bpy.data.meshes)


def test_ticks_lead_to_the_result_while_the_viewport_can_be_turned():
    obj = grid(20)
    context, run = begun(obj, scheme="LOOP")
    assert sent(context, run, "MIDDLEMOUSE") == {"PASS_THROUGH"}
    assert sent(context, run, "TAB") == {"RUNNING_MODAL"}
    assert driven(context, run) == {"FINISHED"}
    new = bpy.context.object
    assert (points_of(new.data) == points_of(refined(obj, scheme="LOOP").data)).all()
    assert context.left == (0, None)
    assert any("Escape stops" in text for text in context.status[:-1])


def test_escape_leaves_everything_as_it_was():
    before, (context, run) = (obj := grid(60)) and blocks(), begun(obj, levels=4)
    while not computations():
        sent(context, run, "TIMER")
    job = computations()[0]._target.__self__
    assert sent(context, run, "ESC") == {"CANCELLED"}
    assert (blocks(), context.left) == (before, (0, None))
    assert run.said == ["Stopped; nothing was changed"]
    # It did not go on to its end: the next block did not begin.
    with pytest.raises(StoppedError):
        job.answer()


def test_escape_while_writing_leaves_nothing_half_made():
    obj = grid(30)

    def pieces():
        """The pieces of work of a run; those that only wait for the thread are no None."""
        return Large(scheme="LOOP", levels=1).begin(Context())._steps

    count = sum(state is None for state in pieces())
    assert count > 8
    for stop in range(1, count + 1):
        before, steps, taken = (chosen(obj), blocks())[1], pieces(), 0
        while taken < stop:
            taken += next(steps) is None
        steps.close()
        assert blocks() == before, stop


def test_whatever_fails_the_status_line_goes():
    context, run = begun(grid(3), scheme="LOOP")
    run.place = lambda *_: {}["no such place"]
    with pytest.raises(KeyError):
        driven(context, run)
    assert context.left == (0, None)
    bad = grid(3, "Bad")
    bad.data.vertices[0].co.x = float("nan")
    context, run = begun(bad)
    assert driven(context, run) == {"CANCELLED"}
    assert "Bad: vertex 0" in run.said[0]
    assert context.left == (0, None)


# --- the extension --------------------------------------------------------------------------------


def test_what_is_installed_is_bundled_and_goes_without_a_trace():
    assert all(package.__file__.startswith(HOME.name) for package in (pns_common, onnxruntime))
    before = traces()
    assert all(before[kind] for kind in ("types", "operators", "properties", "handlers", "menu"))
    cube()
    bpy.ops.object.pns_live_add()
    assert bpy.ops.preferences.addon_disable(module=NAME) == {"FINISHED"}
    try:
        assert not any(traces().values()), traces()
        bpy.context.view_layer.update()
    finally:
        bpy.ops.preferences.addon_enable(module=NAME)
    assert traces() == before


def traces():
    """Traces of the extension in Blender."""
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    handlers = [h for each in lists if isinstance(each, list) for h in each]
    menu = getattr(bpy.types.VIEW3D_MT_object.draw, "_draw_funcs", ())
    live = sys.modules.get(f"{NAME}.live_watch")
    return {
        "types": sorted(n for n in dir(bpy.types) if "pns" in n.lower()),
        "operators": [n for n in dir(bpy.ops.object) if n.startswith("pns_")],
        "properties": [
            p.identifier for p in bpy.types.Mesh.bl_rna.properties if "pns" in p.identifier
        ],
        "handlers": [h.__name__ for h in handlers if h.__module__.startswith(NAME)],
        "menu": [f.__name__ for f in menu if f.__module__.startswith(NAME)],
        "timers": bool(live and bpy.app.timers.is_registered(live.tick)),
    }
