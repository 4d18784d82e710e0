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
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether there is an active object that is shown live."""
        obj = context.object
        if obj is None or obj.type != "MESH" or live.modifier_of(obj) is None:
            cls.poll_message_set("Start live mode first")
            return False
        if not (obj.is_editable and obj.data.is_editable):
            cls.poll_message_set(LINKED)
            return False
        return True


class OBJECT_OT_pns_live_add(bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Show the active mesh refined, and keep it editable"""

    bl_idname = "object.pns_live_add"
    bl_label = "Start Live Mode"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a mesh of this file is active, and not live yet."""
        obj = context.object
        if obj is None or obj.type != "MESH":
            cls.poll_message_set("Select a mesh first")
            return False
        if live.modifier_of(obj) is not None:
            cls.poll_message_set("The object is shown live already")
            return False
        if not (obj.is_editable and obj.data.is_editable):
            cls.poll_message_set(LINKED)
            return False
        return True

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
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the object is live, and its mesh is one that it can part with."""
        if not super().poll(context):
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave the present mode for Object Mode first")
            return False
        return True

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
