"""The modifier of live mode: it shows the cached result in place of the mesh it is given."""

from __future__ import annotations

import bpy

MODIFIER = "PNS Live"
GROUP = ".PNS Live"
INFO = "Result"


def modifier_of(obj: bpy.types.Object) -> bpy.types.NodesModifier | None:
    """Return the live modifier of an object, whatever its user calls it."""
    return next((m for m in obj.modifiers if m.type == "NODES" and _is_live(m)), None)


def add_modifier(obj: bpy.types.Object) -> None:
    """Add it, before all others: an armature then bends the result."""
    if modifier_of(obj) is not None:
        return
    obj.modifiers.new(MODIFIER, "NODES")
    obj.modifiers.move(len(obj.modifiers) - 1, 0)


def remove_modifier(obj: bpy.types.Object) -> None:
    """Take it away, and its nodes when nothing has them any more."""
    modifier = modifier_of(obj)
    if modifier is None:
        return
    group = modifier.node_group
    obj.modifiers.remove(modifier)
    drop_group(group)


def point_at(obj: bpy.types.Object, cache: bpy.types.Object | None) -> None:
    """Show this result, or none; objects that showed the same one before go on doing so."""
    modifier = modifier_of(obj)
    if modifier is None or (cache is not None and result_of(modifier.node_group) == cache):
        return
    before = modifier.node_group
    modifier.node_group = None if cache is None else _group(cache)
    drop_group(before)


def result_of(group: bpy.types.NodeTree | None) -> bpy.types.Object | None:
    """Return the result that a group of nodes gives; None without one."""
    info = None if group is None else group.nodes.get(INFO)
    return None if info is None else info.inputs["Object"].default_value


def _is_live(modifier: bpy.types.NodesModifier) -> bool:
    group = modifier.node_group
    # Its user may have given it nodes of their own: then it is theirs.
    return modifier.name.startswith(MODIFIER) if group is None else group.name.startswith(GROUP)


def _group(cache: bpy.types.Object) -> bpy.types.NodeTree:
    """Return the nodes that give the geometry of an object, as it lies in its own space.

    The object stands in the node and is no input of the modifier: how such inputs are set has
    changed between versions of Blender.
    """
    for group in bpy.data.node_groups:
        if group.name.startswith(GROUP) and result_of(group) == cache:
            return group
    group = new_group(GROUP)
    out = group.nodes.new("NodeGroupOutput")
    info = group.nodes.new("GeometryNodeObjectInfo")
    info.name, info.transform_space = INFO, "ORIGINAL"
    info.inputs["Object"].default_value = cache
    group.links.new(info.outputs["Geometry"], out.inputs["Geometry"])
    return group


def new_group(name: str) -> bpy.types.NodeTree:
    """Make nodes that take geometry and give geometry."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    return group


def drop_group(group: bpy.types.NodeTree | None) -> None:
    """Remove nodes that nothing has any more."""
    if group is not None and group.users == 0:
        bpy.data.node_groups.remove(group)
