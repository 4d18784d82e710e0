"""Panels and overlays: drawn in every state; a layout that only listens stands in for Blender's."""

import bl_ext.user_default.pns_refine.overlay as overlay
import bl_ext.user_default.pns_refine.panel as panel
import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scene import chosen, cube, evaluated, grid, refined, settle, started


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

    def separator(self):
        pass

    def _part(self, **_):
        return Layout(self.lines)

    column = row = box = _part


def drawn(name=""):
    """The lines of a panel; none where it is not shown."""
    cls = getattr(panel, f"VIEW3D_PT_pns{name}")
    if hasattr(cls, "poll") and not cls.poll(bpy.context):
        return ""
    instance = type("Drawn", (), {"layout": Layout()})()
    cls.draw(instance, bpy.context)
    return "\n".join(instance.layout.lines)


def test_the_button_forecasts_and_warns():
    assert "[object.pns_refine]" in drawn()
    assert drawn("_report") == drawn("_live") == drawn("_overlay") == ""
    menu = type("Menu", (), {"layout": Layout()})()
    panel.draw_menu(menu, bpy.context)
    assert menu.layout.lines == ["[object.pns_refine]"]
    obj, last = cube(), bpy.context.window_manager.operator_properties_last("object.pns_refine")
    assert "96 faces from 6" in drawn()
    modifier = obj.modifiers.new("Rounder", "SUBSURF")
    assert "again by: Rounder" in drawn()
    modifier.levels = modifier.render_levels = 0
    assert "Rounder" not in drawn()
    last.detail = "FACES"
    assert "max_faces" in drawn()
    assert "At most 20,000 faces, from 6" in drawn()
    last.detail = "ANGLE"
    assert "Angle is for triangles" in drawn()
    obj.modifiers.new("Cut", "TRIANGULATE")
    bpy.ops.object.modifier_apply(modifier="Cut")
    assert "As many faces as that takes, from 12" in drawn()
    last.detail, last.levels = "LEVELS", 6
    grid(40)
    assert "More than 1,000,000" in drawn()
    last.levels = 2


def test_the_report_has_certificate_in_the_scenes_units_and_losses():
    obj, units = grid(6), bpy.context.scene.unit_settings
    obj.data.attributes.new("id", "INT", "POINT")
    new = refined(obj)
    assert "most parents: id" in drawn("_report")
    units.system, units.scale_length, new.scale = "METRIC", 0.001, (1000, 1000, 1000)
    bpy.context.view_layer.update()
    farthest = new.data.pns_result.pns_distance
    length = bpy.utils.units.to_string("METRIC", "LENGTH", farthest, precision=4)
    assert f"No vertex is farther than {length}" in drawn("_report")
    units.system = "NONE"
    # A parent that shears it stretches it by more than its sides.
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    new.parent, new.rotation_euler.z, parent.scale.x = parent, np.pi / 4, 10
    bpy.context.view_layer.update()
    assert f"{farthest * 10000:.4g}" in drawn("_report")


def test_live_mode_offers_what_can_be_done():
    obj = grid(4)
    assert drawn("_live") == "[object.pns_live_add]"
    started(obj).data.pns_live.problem = "no luck"
    lines = drawn("_live").splitlines()
    assert {"levels", "budget", "limit", "automatic", "no luck"} <= {*lines}
    assert {f"[object.pns_live_{name}]" for name in ("refresh", "apply", "remove")} <= {*lines}


def test_overlays_are_shown_one_at_a_time_and_the_materials_come_back():
    obj = grid(6)
    obj.data.materials.append(bpy.data.materials.new("own"))
    with pytest.raises(RuntimeError, match="Refine the object first"):
        bpy.ops.object.pns_overlay(shown="pns_gate")
    new = refined(obj)
    users = new.modifiers.new(overlay.MODIFIER, "NODES")
    users.node_group = bpy.data.node_groups.new("own", "GeometryNodeTree")
    users.show_viewport = False
    assert "[Materials]*" in drawn("_overlay")
    for name, title in overlay.TITLES.items():
        bpy.ops.object.pns_overlay(shown=name)
        assert overlay.current(new) == name
        new.modifiers[-1].name = "Colours"
        assert [m.name for m in evaluated(new).materials] != ["own"]
        assert f"[{title}]*" in drawn("_overlay")
        assert "ramp\n0" in drawn("_overlay")
        assert (len(new.modifiers), len(bpy.data.materials)) == (2, 2)
    bpy.ops.object.pns_overlay(shown="NONE")
    assert [m.name for m in evaluated(new).materials] == ["own"]
    assert [m.node_group.name for m in new.modifiers] == ["own"]
    assert [m.name for m in bpy.data.materials] == ["own"]


def test_the_ramp_of_a_live_result_goes_to_its_largest_value():
    obj = started(grid(4))
    assert bpy.ops.object.pns_overlay(shown="pns_distance") == {"FINISHED"}
    assert "pns_distance" in evaluated(obj).attributes
    obj.data.transform(Matrix.Scale(10, 4))
    obj.data.update()
    settle()
    scale = overlay.ramp_of(obj).inputs[0].links[0].from_node
    highest = overlay.shown_mesh(obj).pns_result.pns_distance
    assert scale.inputs["From Max"].default_value == highest
    chosen(obj)
    bpy.ops.object.pns_live_remove()
    assert not obj.modifiers
