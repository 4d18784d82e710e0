"""The panels draw in every state; a layout that only listens stands in for Blender's."""

import bl_ext.user_default.pns_refine.panel as panel
import bpy
from scene import chosen, cube, grid, refined


class Layout:
    """Notes what is drawn in it, and in its parts."""

    def __init__(self, lines=None):
        self.lines = [] if lines is None else lines

    def label(self, text="", icon="NONE"):
        self.lines.append(text)

    def operator(self, name, text="", icon="NONE", depress=False):
        self.lines.append(f"[{text or name}]{'*' if depress else ''}")
        return Layout(self.lines)

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties
        self.lines.append(name)

    def template_color_ramp(self, data, name, expand):
        assert getattr(data, name).elements
        self.lines.append("ramp")

    def _part(self, **_):
        return Layout(self.lines)

    column = row = box = _part


def drawn(cls):
    """The lines of a panel; none where it is not shown."""
    if hasattr(cls, "poll") and not cls.poll(bpy.context):
        return []
    instance = type("Drawn", (), {"layout": Layout()})()
    cls.draw(instance, bpy.context)
    return instance.layout.lines


def test_without_an_object_nothing_but_the_button():
    assert drawn(panel.VIEW3D_PT_pns)[0] == "[object.pns_refine]"
    assert drawn(panel.VIEW3D_PT_pns_report) == drawn(panel.VIEW3D_PT_pns_live) == []


def test_the_forecast_stands_below_the_button():
    cube()
    lines = drawn(panel.VIEW3D_PT_pns)
    assert any("96 faces from 6" in line for line in lines)


def test_detail_tells_the_most_faces_and_what_quads_lack():
    cube()
    last = bpy.context.window_manager.operator_properties_last("object.pns_refine")
    last.detail = "FACES"
    lines = drawn(panel.VIEW3D_PT_pns)
    assert "max_faces" in lines
    assert any("quads are cut everywhere" in line for line in lines)
    grid(2)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.quads_convert_to_tris()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert any("At most 20,000 faces, from 8" in line for line in drawn(panel.VIEW3D_PT_pns))
    last.detail = "LEVELS"


def test_a_million_faces_are_warned_of():
    grid(300)
    last = bpy.context.window_manager.operator_properties_last("object.pns_refine")
    last.levels = 3
    assert any("More than 1,000,000" in line for line in drawn(panel.VIEW3D_PT_pns))
    last.levels = 2


def test_a_subdivision_surface_that_acts_again_is_named_before_and_after():
    obj = cube()
    modifier = obj.modifiers.new("Rounder", "SUBSURF")
    assert any("Rounder" in line for line in drawn(panel.VIEW3D_PT_pns))
    refined(obj)
    assert any("again by: Rounder" in line for line in drawn(panel.VIEW3D_PT_pns_report))
    chosen(obj)
    modifier.levels = modifier.render_levels = 0
    assert not any("Rounder" in line for line in drawn(panel.VIEW3D_PT_pns))


def test_the_report_has_certificate_and_losses():
    obj = cube()
    obj.data.attributes.new("id", "INT", "POINT")
    refined(obj)
    text = "\n".join(drawn(panel.VIEW3D_PT_pns_report))
    assert "No vertex is farther than" in text
    assert "most parents: id" in text


def test_the_overlay_has_a_legend_only_when_shown():
    refined(grid(4))
    assert "ramp" not in drawn(panel.VIEW3D_PT_pns_overlay)
    assert "[Materials]*" in drawn(panel.VIEW3D_PT_pns_overlay)
    bpy.ops.object.pns_overlay(shown="pns_distance")
    lines = drawn(panel.VIEW3D_PT_pns_overlay)
    assert "ramp" in lines
    assert "[Distance from plain scheme]*" in lines
    assert lines[lines.index("ramp") + 1] == "0"


def test_live_mode_offers_what_can_be_done():
    obj = grid(4)
    assert drawn(panel.VIEW3D_PT_pns_live) == ["[object.pns_live_add]"]
    bpy.ops.object.pns_live_add()
    obj.data.pns_live.problem = "no luck"
    lines = drawn(panel.VIEW3D_PT_pns_live)
    assert {"levels", "budget", "limit", "automatic", "no luck"} <= set(lines)
    assert {f"[object.pns_live_{name}]" for name in ("refresh", "apply", "remove")} <= set(lines)


def test_the_menu_entry_draws():
    menu = type("Menu", (), {"layout": Layout()})()
    menu.layout.separator = lambda: None
    panel.draw_menu(menu, bpy.context)
    assert menu.layout.lines == ["[object.pns_refine]"]
