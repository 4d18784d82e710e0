"""The large form of the operator, driven by events that a test makes up."""

import threading
from types import SimpleNamespace

import bl_ext.user_default.pns_refine.operator as operator
import bpy
import pytest
from bl_ext.user_default.pns_refine.refining.job import StoppedError
from scene import chosen, grid, points_of, refined


class Large(operator.Refining):
    """The operator as Blender would hold it: its settings, and somewhere to report to."""

    def __init__(self, **settings):
        self.levels, self.scheme, self.model, self.model_file = 2, "PNS", "general", ""
        self.budget, self.limit, self.crease_angle, self.border = 0.5, True, 10.0, "ALL"
        self.crease_lines, self.keep_original, self.beside = True, True, True
        self.uv_smooth, self.detail = "PRESERVE_BOUNDARIES", "LEVELS"
        self.said = []
        for name, value in settings.items():
            setattr(self, name, value)

    def report(self, kind, text):
        self.said.append(text)

    invoke = operator.OBJECT_OT_pns_refine_large.invoke
    modal = operator.OBJECT_OT_pns_refine_large.modal
    end = operator.OBJECT_OT_pns_refine_large.end
    cancel = operator.OBJECT_OT_pns_refine_large.cancel


class Context:
    """A context with a window manager and a workspace that note what they are told."""

    def __init__(self):
        self.status, self.timers, self.handlers = [], 0, []
        self.window = None
        self.window_manager = SimpleNamespace(
            event_timer_add=self.add_timer,
            event_timer_remove=self.remove_timer,
            modal_handler_add=self.handlers.append,
        )
        self.workspace = SimpleNamespace(status_text_set=self.status.append)

    def __getattr__(self, name):
        return getattr(bpy.context, name)

    def add_timer(self, step, window):
        self.timers += 1
        return "timer"

    def remove_timer(self, timer):
        self.timers -= 1


def event(kind):
    return SimpleNamespace(type=kind)


def computations():
    """The threads that compute for the operator now."""
    return [thread for thread in threading.enumerate() if thread.name == "pns-refine"]


def driven(run, context, kind="TIMER"):
    """Tick until it ends, each tick after what computes has ended; how it ended."""
    for _ in range(10_000):
        answer = run.modal(context, event(kind))
        if not answer & {"PASS_THROUGH", "RUNNING_MODAL"}:
            return answer
        for thread in computations():
            thread.join()
    raise AssertionError("it never ends")


def test_ticks_lead_to_the_result_of_the_operator():
    obj = grid(20)
    context, run = Context(), Large(scheme="LOOP")
    assert run.invoke(context, event("LEFTMOUSE")) == {"RUNNING_MODAL"}
    assert context.handlers == [run]
    assert driven(run, context) == {"FINISHED"}
    new = bpy.context.object
    assert (points_of(new.data) == points_of(refined(obj, scheme="LOOP").data)).all()
    assert context.timers == 0
    assert context.status[-1] is None
    assert any("Escape stops" in text for text in context.status[:-1])


def test_escape_leaves_everything_as_it_was():
    obj = grid(60)
    names = (set(bpy.data.objects), set(bpy.data.meshes))
    context, run = Context(), Large(levels=4)
    run.invoke(context, event("LEFTMOUSE"))
    while not computations():
        run.modal(context, event("TIMER"))
    (thread,) = computations()
    job = thread._target.__self__
    assert run.modal(context, event("ESC")) == {"CANCELLED"}
    assert (set(bpy.data.objects), set(bpy.data.meshes)) == names
    assert context.timers == 0
    assert context.status[-1] is None
    assert run.said == ["Stopped; nothing was changed"]
    # It did not go on to its end: the next block did not begin.
    with pytest.raises(StoppedError):
        job.answer()
    assert obj.data.vertices


def test_escape_while_writing_leaves_nothing_half_made():
    grid(30)
    pieces = sum(state is None for state in begun())
    assert pieces > 8
    for stop in range(1, pieces + 1):
        names = (set(bpy.data.objects), set(bpy.data.meshes))
        steps, taken = begun(), 0
        while taken < stop:
            taken += next(steps) is None
        steps.close()
        assert (set(bpy.data.objects), set(bpy.data.meshes)) == names, stop


def begun():
    """The pieces of work of a run; those that only wait for the thread are no None."""
    return Large(scheme="LOOP", levels=1).begin(Context())._steps


def test_the_viewport_can_be_turned_and_nothing_else():
    grid(30)
    context, run = Context(), Large(scheme="LOOP")
    run.invoke(context, event("LEFTMOUSE"))
    assert run.modal(context, event("MIDDLEMOUSE")) == {"PASS_THROUGH"}
    assert run.modal(context, event("TAB")) == {"RUNNING_MODAL"}
    assert driven(run, context) == {"FINISHED"}


def test_whatever_fails_the_status_line_goes():
    grid(3)
    context, run = Context(), Large(scheme="LOOP")
    run.invoke(context, event("LEFTMOUSE"))
    run.place = lambda *_: {}["no such place"]
    with pytest.raises(KeyError):
        driven(run, context)
    assert context.timers == 0
    assert context.status[-1] is None


def test_a_mesh_that_cannot_be_refined_is_reported():
    obj = grid(3)
    obj.data.vertices[0].co.x = float("nan")
    chosen(obj)
    context, run = Context(), Large()
    run.invoke(context, event("LEFTMOUSE"))
    assert driven(run, context) == {"CANCELLED"}
    assert "vertex 0" in run.said[0]
    assert context.timers == 0
