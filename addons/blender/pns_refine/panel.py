"""The panels in the sidebar, and the entry in the Object menu."""

from __future__ import annotations

import json

import bpy

from . import live
from .operator import OBJECT_OT_pns_refine, chosen_objects, draw_forecast, draw_subdivided
from .overlay import TITLES, current, ramp_of, shown_mesh
from .result import certificate_lines, in_units, largest_scale
from .settings import GOAL_OF


class _Panel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "PNS"


class VIEW3D_PT_pns(_Panel, bpy.types.Panel):  # noqa: N801 (Blender's names)
    """Refine, and how many faces that makes."""

    bl_label = "PNS Refine"

    def draw(self, context: bpy.types.Context) -> None:
        """Show the operator with the settings it last had."""
        layout = self.layout
        layout.operator(OBJECT_OT_pns_refine.bl_idname, icon="MOD_SUBSURF")
        last = context.window_manager.operator_properties_last(OBJECT_OT_pns_refine.bl_idname)
        layout.prop(last, "detail")
        layout.prop(last, GOAL_OF[last.detail])
        if context.object is not None and chosen_objects(context):
            draw_forecast(layout, chosen_objects(context), last)


class _OfResult(_Panel):
    """A panel on the active object, if it was refined."""

    bl_parent_id = "VIEW3D_PT_pns"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the active object was refined."""
        return shown_mesh(context.object) is not None


class VIEW3D_PT_pns_report(_OfResult, bpy.types.Panel):  # noqa: N801 (Blender's names)
    """The certificate of the active object, and what is lost."""

    bl_label = "Report"

    def draw(self, context: bpy.types.Context) -> None:
        """Show sentences."""
        mesh = shown_mesh(context.object)
        column = self.layout.column(align=True)
        for line in certificate_lines(context.object, mesh, context.scene):
            column.label(text=line)
        draw_subdivided(self.layout, [context.object])
        notes = json.loads(mesh.pns_result.notes or "[]")
        if notes:
            box = self.layout.box().column(align=True)
            for line in notes:
                box.label(text=line, icon="DOT")


class VIEW3D_PT_pns_overlay(_OfResult, bpy.types.Panel):  # noqa: N801 (Blender's names)
    """Panel of the diagnostic that is shown, with its legend."""

    bl_label = "Overlay"

    def draw(self, context: bpy.types.Context) -> None:
        """Show a button for each, and the ramp from 0 to the largest value."""
        obj, layout = context.object, self.layout
        now = current(obj)
        column = layout.column(align=True)
        for name, title in [("NONE", "Materials"), *TITLES.items()]:
            button = column.operator(
                "object.pns_overlay", text=title, depress=(now or "NONE") == name
            )
            button.shown = name
        ramp = ramp_of(obj)
        if ramp is None:
            return
        layout.template_color_ramp(ramp, "color_ramp", expand=False)
        highest = getattr(shown_mesh(obj).pns_result, now)
        length = highest * largest_scale(obj)
        text = f"{highest:.3g}" if now != "pns_distance" else in_units(length, context.scene)
        row = layout.row()
        row.label(text="0")
        row.label(text=text)
        layout.label(text="Seen in Material Preview and Rendered shading", icon="INFO")


class VIEW3D_PT_pns_live(_Panel, bpy.types.Panel):  # noqa: N801 (Blender's names)
    """Live mode of the active object."""

    bl_label = "Live Mode"
    bl_parent_id = "VIEW3D_PT_pns"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a mesh is active."""
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context: bpy.types.Context) -> None:
        """Start; or the settings, and what can be done."""
        obj, layout = context.object, self.layout
        if live.modifier_of(obj) is None:
            layout.operator("object.pns_live_add")
            return
        settings = obj.data.pns_live
        layout.use_property_split = True
        settings.draw_settings(layout)
        layout.prop(settings, "render_levels")
        layout.prop(settings, "automatic")
        draw_forecast(layout, [obj], settings)
        if settings.problem:
            layout.label(text=settings.problem, icon="ERROR")
        row = layout.row(align=True)
        for name in ("refresh", "apply", "remove"):
            row.operator(f"object.pns_live_{name}")


def draw_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Show the entry in the Object menu."""
    menu.layout.separator()
    menu.layout.operator(OBJECT_OT_pns_refine.bl_idname, icon="MOD_SUBSURF")
