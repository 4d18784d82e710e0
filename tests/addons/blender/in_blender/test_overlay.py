"""Overlays show what was measured, and leave no trace."""

import bl_ext.user_default.pns_refine.overlay as overlay
import bl_ext.user_default.pns_refine.result as result
import bpy
import numpy as np
import pytest
from live_scene import settle
from mathutils import Matrix
from scene import cube, evaluated, grid, numbers, points_of, refined


@pytest.mark.parametrize("make", [lambda: grid(6), cube], ids=["smooth", "with lines"])
def test_the_distance_is_that_from_the_plain_scheme(make):
    obj = make()
    new, plain = refined(obj), refined(obj, budget=0.0)
    expected = np.linalg.norm(points_of(new.data) - points_of(plain.data), axis=1)
    distances = numbers(new.data.attributes["pns_distance"].data, "value").ravel()
    np.testing.assert_allclose(distances, expected, atol=1e-6)
    assert distances.max() == pytest.approx(new.data.pns_result.pns_distance)


def test_ratio_and_gate_stand_at_the_points():
    new = refined(grid(6)).data
    for name in ("pns_ratio", "pns_gate"):
        values = numbers(new.attributes[name].data, "value")
        assert values.max() > 0
        assert values.max() <= 1 + 1e-6


@pytest.mark.parametrize("name", list(overlay.TITLES))
def test_an_overlay_is_shown_and_the_materials_come_back(name):
    obj = grid(6)
    obj.data.materials.append(bpy.data.materials.new("own"))
    new = refined(obj)
    assert bpy.ops.object.pns_overlay(shown=name) == {"FINISHED"}
    assert overlay.current(new) == name
    assert [m.name for m in evaluated(new).materials] != ["own"]
    assert len(overlay.ramp_of(new).color_ramp.elements) == len(overlay.COLOURS)
    bpy.ops.object.pns_overlay(shown="NONE")
    assert [m.name for m in evaluated(new).materials] == ["own"]
    assert [m.name for m in bpy.data.materials] == ["own"]
    assert not new.modifiers
    assert not bpy.data.node_groups


def test_changing_the_overlay_leaves_one():
    new = refined(grid(4))
    for name in overlay.TITLES:
        bpy.ops.object.pns_overlay(shown=name)
    assert len(new.modifiers) == 1
    assert len(bpy.data.materials) == 1


def test_an_overlay_under_another_name_is_followed():
    new = refined(grid(4))
    bpy.ops.object.pns_overlay(shown="pns_gate")
    new.modifiers[0].name = "Colours"
    bpy.ops.object.pns_overlay(shown="pns_ratio")
    assert overlay.current(new) == "pns_ratio"
    assert len(new.modifiers) == 1
    new.modifiers[0].name = "Colours"
    bpy.ops.object.pns_overlay(shown="NONE")
    assert not new.modifiers


def test_a_modifier_of_its_user_s_own_is_no_overlay():
    new = refined(grid(4))
    own = new.modifiers.new(overlay.MODIFIER, "NODES")
    own.node_group = bpy.data.node_groups.new("own", "GeometryNodeTree")
    assert overlay.current(new) is None
    bpy.ops.object.pns_overlay(shown="pns_ratio")
    bpy.ops.object.pns_overlay(shown="NONE")
    assert [m.node_group.name for m in new.modifiers] == ["own"]


def test_an_object_that_was_not_refined_has_none():
    cube()
    with pytest.raises(RuntimeError, match="Refine the object first"):
        bpy.ops.object.pns_overlay(shown="pns_gate")


def test_live_results_have_overlays_too():
    obj = grid(4)
    bpy.ops.object.pns_live_add()
    assert bpy.ops.object.pns_overlay(shown="pns_distance") == {"FINISHED"}
    assert "pns_distance" in evaluated(obj).attributes
    obj.data.transform(Matrix.Scale(10, 4))
    obj.data.update()
    settle()
    # The ramp's end is what the legend says.
    scale = overlay.ramp_of(obj).inputs[0]
    highest = scale.links[0].from_node.inputs["From Max"].default_value
    assert highest == overlay.shown_mesh(obj).pns_result.pns_distance
    bpy.ops.object.pns_live_remove()
    assert not obj.modifiers


def test_the_certificate_is_in_the_scenes_units():
    new = refined(grid(6))
    scene = bpy.context.scene
    scene.unit_settings.system = "METRIC"
    scene.unit_settings.scale_length = 0.001
    new.scale = (1000, 1000, 1000)
    bpy.context.view_layer.update()
    text = " ".join(result.certificate_lines(new, new.data, scene))
    farthest = new.data.pns_result.pns_distance
    assert result.in_units(farthest * 1000, scene) in text
    assert "m" in result.in_units(farthest * 1000, scene)
    scene.unit_settings.system = "NONE"
    # A parent that shears it stretches it by more than its sides.
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    new.parent, new.rotation_euler.z, parent.scale.x = parent, np.pi / 4, 10
    bpy.context.view_layer.update()
    text = " ".join(result.certificate_lines(new, new.data, scene))
    assert f"{farthest * 10000:.4g}" in text
    parent.scale.x = 1
    bpy.context.view_layer.update()
    assert f"{farthest * 1000:.4g}" in " ".join(result.certificate_lines(new, new.data, scene))
