"""The operators of live mode."""

from __future__ import annotations

import bpy

from pns_common import PnsError

from . import live
from .live_nodes import add_modifier
from .run import Run, Share, Steps

LINKED = "Linked from another file, which alone can keep live mode: make it local first"


class _OfLive:
    """An operator on the active object, if that is shown live."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def problem(cls, context: bpy.types.Context) -> str | None:
        """Return why the operator cannot be used."""
        obj = context.object
        if obj is None or obj.type != "MESH" or live.modifier_of(obj) is None:
            return "Start live mode first"
        return None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the operator can be used on the active object."""
        problem, obj = cls.problem(context), context.object
        if problem is None and not (obj.is_editable and obj.data.is_editable):
            problem = "Linked from another file: make it local first, as live mode is kept in it"
        if problem is not None:
            cls.poll_message_set(problem)
        return problem is None


class OBJECT_OT_pns_live_add(_OfLive, bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Show the active mesh refined, and keep it editable"""

    bl_idname = "object.pns_live_add"
    bl_label = "Start Live Mode"

    @classmethod
    def problem(cls, context: bpy.types.Context) -> str | None:
        """Return why live mode cannot be started."""
        obj = context.object
        if obj is None or obj.type != "MESH":
            return "Select a mesh first"
        return None if live.modifier_of(obj) is None else "The object is shown live already"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Start, and refine for the first time."""
        add_modifier(context.object)
        result = refresh(self, context.object)
        if result == {"CANCELLED"}:
            live.remove(context.object)
        return result


class OBJECT_OT_pns_live_refresh(_OfLive, bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Refine the base mesh again"""

    bl_idname = "object.pns_live_refresh"
    bl_label = "Refresh"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Refine again."""
        return refresh(self, context.object)


class OBJECT_OT_pns_live_apply(_OfLive, bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Give the object the refined mesh for good"""

    bl_idname = "object.pns_live_apply"
    bl_label = "Apply"

    @classmethod
    def problem(cls, context: bpy.types.Context) -> str | None:
        """Return why the object cannot have the refined mesh."""
        left = context.mode == "OBJECT"
        return super().problem(context) or (
            None if left else "Leave the present mode for Object Mode first"
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Refine a last time, and apply."""
        return finished(self, live.apply(context.object))


class OBJECT_OT_pns_live_remove(_OfLive, bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Show the base mesh again"""

    bl_idname = "object.pns_live_remove"
    bl_label = "Remove"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Take live mode away."""
        live.remove(context.object)
        return {"FINISHED"}


def refresh(operator: bpy.types.Operator, obj: bpy.types.Object) -> set[str]:
    """Refresh an object at once, and report what is wrong."""
    return finished(operator, live.refreshed(obj, Share()))


def finished(operator: bpy.types.Operator, steps: Steps) -> set[str]:
    """Take steps to their end at once, and report what is wrong."""
    try:
        Run(steps).finish()
    except PnsError as error:
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    return {"FINISHED"}
