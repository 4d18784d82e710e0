"""Materials: clay, stripes of reflected light, wire over clay, and colours of a field."""

from __future__ import annotations

from collections.abc import Callable

import bpy

Colour = tuple[float, float, float, float]
CLAY = (0.42, 0.245, 0.165, 1)
DARK, LIGHT = (0.012, 0.014, 0.02, 1), (0.72, 0.74, 0.78, 1)
STRIPES = 9.0
# The width of a wire, in pixels.
WIRE = 0.7
# Viridis at nine places, as light: readable without red and green, and in grey.
VIRIDIS = (
    (0.0578, 0.0004, 0.0887),
    (0.0628, 0.0253, 0.1789),
    (0.0423, 0.0846, 0.2581),
    (0.0259, 0.1470, 0.2705),
    (0.0147, 0.2227, 0.2643),
    (0.0141, 0.3467, 0.2232),
    (0.0707, 0.4897, 0.1510),
    (0.3139, 0.6239, 0.0513),
    (0.9867, 0.7991, 0.0185),
)


def clay() -> bpy.types.Material:
    """Make matt clay with a soft highlight, which shows where curvature jumps."""
    material, shader = _principled("clay")
    shader.inputs["Base Color"].default_value = CLAY
    shader.inputs["Roughness"].default_value = 0.38
    return material


def zebra() -> bpy.types.Material:
    """Make stripes of light as a polished surface reflects them: they kink where normals do."""
    material, tree, glow = _glowing("zebra")
    where = tree.nodes.new("ShaderNodeTexCoord")
    axes = tree.nodes.new("ShaderNodeSeparateXYZ")
    wave = _maths(tree, "SINE", _maths(tree, "MULTIPLY", axes.outputs["Z"], STRIPES))
    # A steep ramp between the stripes instead of a step: no jagged edges.
    edge = tree.nodes.new("ShaderNodeMapRange")
    edge.inputs["From Min"].default_value, edge.inputs["From Max"].default_value = -0.12, 0.12
    tree.links.new(where.outputs["Reflection"], axes.inputs["Vector"])
    tree.links.new(wave, edge.inputs["Value"])
    tree.links.new(_mixed(tree, edge.outputs["Result"], DARK, LIGHT), glow.inputs["Color"])
    return material


def wire() -> bpy.types.Material:
    """Make clay with its edges drawn."""
    material, shader = _principled("wire")
    tree = material.node_tree
    lines = tree.nodes.new("ShaderNodeWireframe")
    lines.use_pixel_size = True
    lines.inputs["Size"].default_value = WIRE
    colours = (0.75, 0.72, 0.68, 1), (0.05, 0.05, 0.06, 1)
    mixed = _mixed(tree, lines.outputs["Fac"], *colours)
    tree.links.new(mixed, shader.inputs["Base Color"])
    shader.inputs["Roughness"].default_value = 0.6
    return material


def heat(field: str, highest: float) -> bpy.types.Material:
    """Colour a field from 0 to ``highest``, shaded softly so that the form still shows."""
    material, shader = _principled(f"heat {field}")
    tree = material.node_tree
    value = tree.nodes.new("ShaderNodeAttribute")
    value.attribute_name = field
    scale = tree.nodes.new("ShaderNodeMapRange")
    scale.inputs["From Max"].default_value = highest if highest > 0 else 1.0
    ramp = colour_ramp(tree)
    tree.links.new(value.outputs["Fac"], scale.inputs["Value"])
    tree.links.new(scale.outputs["Result"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    shader.inputs["Roughness"].default_value = 0.8
    return material


def bar() -> bpy.types.Material:
    """Make the ramp itself along a plane's first texture coordinate, for a legend."""
    material, tree, glow = _glowing("bar")
    where = tree.nodes.new("ShaderNodeTexCoord")
    axes = tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = colour_ramp(tree)
    tree.links.new(where.outputs["Generated"], axes.inputs["Vector"])
    tree.links.new(axes.outputs["X"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], glow.inputs["Color"])
    return material


def ink() -> bpy.types.Material:
    """Make what letters are drawn with: no light falls on them."""
    material, _, glow = _glowing("ink")
    glow.inputs["Color"].default_value = (0.01, 0.01, 0.012, 1)
    return material


def colour_ramp(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """Make viridis as a node."""
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    elements = ramp.color_ramp.elements
    while len(elements) < len(VIRIDIS):
        elements.new(0.5)
    for number, (element, colour) in enumerate(zip(elements, VIRIDIS, strict=True)):
        element.position = number / (len(VIRIDIS) - 1)
        element.color = (*colour, 1)
    return ramp


# Looks that need no field.
LOOKS: dict[str, Callable[[], bpy.types.Material]] = {"clay": clay, "zebra": zebra, "wire": wire}


def _principled(name: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    return material, next(node for node in nodes if node.type == "BSDF_PRINCIPLED")


def _glowing(name: str) -> tuple[bpy.types.Material, bpy.types.NodeTree, bpy.types.Node]:
    """Return a material that gives light of its own, its nodes, and that which makes the light."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    out, glow = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(glow.outputs["Emission"], out.inputs["Surface"])
    return material, tree, glow


def _mixed(
    tree: bpy.types.NodeTree, share: bpy.types.NodeSocket, first: Colour, second: Colour
) -> bpy.types.NodeSocket:
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    low, high = (socket for socket in mix.inputs if socket.type == "RGBA")
    low.default_value, high.default_value = first, second
    tree.links.new(share, mix.inputs["Factor"])
    return next(socket for socket in mix.outputs if socket.type == "RGBA")


def _maths(
    tree: bpy.types.NodeTree, operation: str, first: bpy.types.NodeSocket, second: float = 0.0
) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    node.inputs[1].default_value = second
    tree.links.new(first, node.inputs[0])
    return node.outputs["Value"]
