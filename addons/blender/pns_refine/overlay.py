"""Overlays: one diagnostic in colours, by a modifier that sets a material on what it is given.

The object's own materials stay where they are: to take the modifier away is to restore them.
"""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from .live_nodes import drop_group, modifier_of, new_group

MODIFIER = "PNS Overlay"
GROUP = ".PNS Overlay"
MATERIAL = ".PNS Overlay"
RAMP, ATTRIBUTE, PAINT, SCALE = "Ramp", "Attribute", "Paint", "Scale"
TITLES = {
    "pns_ratio": "Proximity ratio",
    "pns_gate": "Gate",
    "pns_distance": "Distance from plain scheme",
}
# Viridis at five places: even steps of lightness, and readable without red and green.
COLOURS = (
    (0.267, 0.005, 0.329),
    (0.229, 0.322, 0.546),
    (0.128, 0.567, 0.551),
    (0.369, 0.789, 0.383),
    (0.993, 0.906, 0.144),
)


class OBJECT_OT_pns_overlay(bpy.types.Operator):  # noqa: N801 (Blender's names)
    """Show a diagnostic of the refined surface in colours, or the materials again"""

    bl_idname = "object.pns_overlay"
    bl_label = "PNS Overlay"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    shown: EnumProperty(
        name="Shown",
        items=[("NONE", "Materials", "The object's own materials")]
        + [(name, title, f"{title}, by a colour ramp") for name, title in TITLES.items()],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the active object was refined."""
        if shown_mesh(context.object) is None:
            cls.poll_message_set("Refine the object first")
            return False
        if not context.object.is_editable:
            cls.poll_message_set("Linked from another file, and not to be changed here")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show it."""
        obj = context.object
        hide(obj)
        if self.shown != "NONE":
            show(obj, self.shown, getattr(shown_mesh(obj).pns_result, self.shown))
        return {"FINISHED"}


def shown_mesh(obj: bpy.types.Object | None) -> bpy.types.Mesh | None:
    """Return the refined mesh that an object shows: its own, or a live result; None if neither."""
    if obj is None or obj.type != "MESH":
        return None
    # A modifier may be taken away, or applied, by hand: then the base is what is seen.
    cache = None if modifier_of(obj) is None else obj.data.pns_live.cache
    mesh = obj.data if cache is None else cache.data
    return mesh if mesh.pns_result.report else None


def current(obj: bpy.types.Object) -> str | None:
    """Return the diagnostic that is shown, if any."""
    material = _material(obj)
    return None if material is None else material.node_tree.nodes[ATTRIBUTE].attribute_name


def ramp_of(obj: bpy.types.Object) -> bpy.types.Node | None:
    """Return the colour ramp of an object's overlay, to be shown as its legend."""
    material = _material(obj)
    return None if material is None else material.node_tree.nodes[RAMP]


def show(obj: bpy.types.Object, name: str, highest: float) -> None:
    """Show the attribute ``name``, from 0 to ``highest``."""
    obj.modifiers.new(MODIFIER, "NODES").node_group = _group(ramp_material(name, highest))


def rescale(obj: bpy.types.Object) -> None:
    """Let the ramp of an overlay go to the largest value of the mesh that is shown now."""
    material, mesh = _material(obj), shown_mesh(obj)
    if material is not None and mesh is not None:
        highest = getattr(mesh.pns_result, current(obj))
        _scale_to(material.node_tree.nodes[SCALE], highest)


def hide(obj: bpy.types.Object) -> None:
    """Take the overlay away, and its nodes and material when nothing has them any more."""
    modifier, material = _modifier(obj), _material(obj)
    if modifier is None:
        return
    group = modifier.node_group
    obj.modifiers.remove(modifier)
    drop_group(group)
    if material is not None and material.users == 0:
        bpy.data.materials.remove(material)


def ramp_material(name: str, highest: float) -> bpy.types.Material:
    """Make a material that colours by an attribute, from 0 to ``highest``."""
    material = bpy.data.materials.new(MATERIAL)
    if material.node_tree is None:
        # Before 5.0; since then all materials have nodes.
        material.use_nodes = True
    tree = material.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = 0.7
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.name, attribute.attribute_name = ATTRIBUTE, name
    scale = tree.nodes.new("ShaderNodeMapRange")
    scale.name = SCALE
    _scale_to(scale, highest)
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.name = RAMP
    elements = ramp.color_ramp.elements
    while len(elements) < len(COLOURS):
        elements.new(0.5)
    for number, (element, colour) in enumerate(zip(elements, COLOURS, strict=True)):
        element.position = number / (len(COLOURS) - 1)
        element.color = (*(_linear(channel) for channel in colour), 1)
    tree.links.new(attribute.outputs["Fac"], scale.inputs["Value"])
    tree.links.new(scale.outputs["Result"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    return material


def _scale_to(scale: bpy.types.Node, highest: float) -> None:
    scale.inputs["From Max"].default_value = highest if highest > 0 else 1.0


def _linear(channel: float) -> float:
    """Return a channel of sRGB as light."""
    return channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4


def _group(material: bpy.types.Material) -> bpy.types.NodeTree:
    """Return the nodes that set a material on all faces; it stands in its node."""
    group = new_group(GROUP)
    into, out = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    paint = group.nodes.new("GeometryNodeSetMaterial")
    paint.name = PAINT
    paint.inputs["Material"].default_value = material
    group.links.new(into.outputs["Geometry"], paint.inputs["Geometry"])
    group.links.new(paint.outputs["Geometry"], out.inputs["Geometry"])
    return group


def _modifier(obj: bpy.types.Object) -> bpy.types.NodesModifier | None:
    """Return the modifier of an object's overlay, whatever its user calls it."""
    return next((m for m in obj.modifiers if m.type == "NODES" and _paints(m.node_group)), None)


def _paints(group: bpy.types.NodeTree | None) -> bool:
    return group is not None and group.name.startswith(GROUP) and PAINT in group.nodes


def _material(obj: bpy.types.Object) -> bpy.types.Material | None:
    """Return the material of an object's overlay."""
    modifier = _modifier(obj)
    if modifier is None:
        return None
    return modifier.node_group.nodes[PAINT].inputs["Material"].default_value
