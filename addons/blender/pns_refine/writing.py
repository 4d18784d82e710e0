"""A refined snapshot as a Blender mesh, written in pieces that do not hold up the interface."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import bpy
import numpy as np

from .animation import copy_animation
from .attributes import is_carried, write_layer
from .reading import FREESTYLE, Reading
from .refining.creases import crease_of
from .refining.snapshot import Refined

# What a mesh that is shown live says of its refined copy, and of itself.
CACHE = ("cache", "spare", "first", "second")
LIVE = ("enabled", *CACHE, "problem")

# Attributes that the overlays show.
SHOWN = ("pns_ratio", "pns_gate", "pns_distance")
CARRIER = ".pns carrier"
# Since this version custom normals are an attribute that may be written as such, and at once.
FREE_NORMALS = (5, 0, 0)


def write_mesh(
    refined: Refined,
    reading: Reading,
    source: bpy.types.Mesh,
    into: bpy.types.Mesh | None = None,
) -> Generator[None, None, tuple[bpy.types.Mesh, list[str]]]:
    """Write a new mesh, as ``source`` in all but its geometry; yields between pieces.

    ``into`` is a mesh to write in its place: what it held is lost, and it gets no more than
    geometry and materials. Returns the mesh, and what Blender would not take, in words. Nothing is
    left behind if the generator is closed before its end.
    """
    mesh = copied(source) if into is None else into
    carrier = bpy.data.objects.new(CARRIER, mesh)
    try:
        if mesh.shape_keys is not None:
            carrier.shape_key_clear()
        mesh.clear_geometry()
        if into is not None:
            mesh.materials.clear()
            for material in source.materials:
                mesh.materials.append(material)
        yield
        yield from _write_faces(mesh, refined)
        lost = yield from _write_layers(mesh, refined)
        yield from _write_groups(carrier, refined, reading)
        yield from _write_keys(carrier, refined, reading, source)
        if into is None and source.shape_keys is not None:
            copy_animation(source.shape_keys, mesh.shape_keys)
        yield from _write_normals(mesh, refined)
        _choose_as(mesh, source)
        mesh.update()
    except BaseException:
        bpy.data.objects.remove(carrier)
        if into is None:
            bpy.data.meshes.remove(mesh)
        else:
            into.clear_geometry()
        raise
    bpy.data.objects.remove(carrier)
    return mesh, lost


def copied(source: bpy.types.Mesh) -> bpy.types.Mesh:
    """Return a copy that is not shown live, as its source may be."""
    mesh = source.copy()
    for name in LIVE:
        mesh.pns_live.property_unset(name)
    return mesh


def take_name(mesh: bpy.types.Mesh, source: bpy.types.Mesh) -> None:
    """Call a refined mesh as its source was, which nothing has any more: files keep that name."""
    if source.users or source.library is not None:
        return
    name = source.name
    # A name is given to one at a time.
    source.name = f"{name} before"
    mesh.name = name


def _write_faces(mesh: bpy.types.Mesh, refined: Refined) -> Iterator[None]:
    faces = refined.topology
    mesh.vertices.add(len(refined.points))
    mesh.edges.add(len(refined.edges))
    yield
    mesh.loops.add(len(faces.corners))
    mesh.polygons.add(faces.face_count)
    yield
    mesh.attributes["position"].data.foreach_set("vector", _flat(refined.points, np.float32))
    yield
    # Attributes are copied as a block; the same numbers as properties are set one by one.
    mesh.attributes[".edge_verts"].data.foreach_set("value", _flat(refined.edges, np.int32))
    yield
    mesh.polygons.foreach_set("loop_start", _flat(faces.offsets[:-1], np.int32))
    yield
    mesh.attributes[".corner_vert"].data.foreach_set("value", _flat(faces.corners, np.int32))
    yield
    mesh.attributes[".corner_edge"].data.foreach_set("value", _flat(faces.corner_edges, np.int32))
    yield


def _write_layers(mesh: bpy.types.Mesh, refined: Refined) -> Generator[None, None, list[str]]:
    lost = []
    for layer in refined.layers:
        if layer.kind == FREESTYLE:
            rows = mesh.edges if layer.domain == "EDGE" else mesh.polygons
            rows.foreach_set("use_freestyle_mark", _flat(layer.values, np.bool_))
        elif is_carried(layer.name) and layer.kind != "NORMAL":
            try:
                yield from write_layer(mesh, layer)
            except (RuntimeError, KeyError) as error:
                lost.append(f"Attribute {layer.name}: {error}")
        yield
    if (refined.crease_sharpness > 0).any():
        _write_floats(mesh, "crease_edge", crease_of(refined.crease_sharpness), "EDGE")
    if (refined.vertex_sharpness > 0).any():
        _write_floats(mesh, "crease_vert", crease_of(refined.vertex_sharpness))
    for name, values in zip(SHOWN, (refined.ratio, refined.gate, refined.distance), strict=True):
        _write_floats(mesh, name, values)
        yield
    return lost


def _write_floats(
    mesh: bpy.types.Mesh, name: str, values: np.ndarray, domain: str = "POINT"
) -> bpy.types.Attribute:
    attribute = mesh.attributes.new(name, "FLOAT", domain)
    attribute.data.foreach_set("value", _flat(values, np.float32))
    return attribute


def _write_groups(carrier: bpy.types.Object, refined: Refined, reading: Reading) -> Iterator[None]:
    """Write vertex groups as attributes, which Blender turns into groups itself, and fast."""
    mesh = carrier.data
    for group, weights in zip(reading.groups, refined.groups.T, strict=True):
        attribute = _write_floats(mesh, ".pns weights", weights)
        mesh.attributes.active = mesh.attributes[attribute.name]
        # Whatever is edited meanwhile, the carrier is not.
        with bpy.context.temp_override(object=carrier, active_object=carrier, edit_object=None):
            bpy.ops.geometry.attribute_convert(mode="VERTEX_GROUP")
        made = carrier.vertex_groups[-1]
        made.name, made.lock_weight = group.name, group.lock_weight
        yield


def _write_keys(
    carrier: bpy.types.Object, refined: Refined, reading: Reading, source: bpy.types.Mesh
) -> Iterator[None]:
    old = source.shape_keys
    if old is None:
        return
    for name, offset in zip(reading.key_names, refined.offsets, strict=True):
        block = carrier.shape_key_add(name=name, from_mix=False)
        block.points.foreach_set("co", _flat(refined.points + offset, np.float32))
        yield
    new = carrier.data.shape_keys
    new.name = old.name
    for before, after in zip(old.key_blocks, new.key_blocks, strict=True):
        after.name = before.name
        after.relative_key = new.key_blocks[before.relative_key.name]
        # The slider's ends first: they clip the value.
        for name in ("slider_min", "slider_max", "value", "mute", "vertex_group", "interpolation"):
            setattr(after, name, getattr(before, name))
        if hasattr(before, "lock_shape"):
            after.lock_shape = before.lock_shape
    for name, value in old.items():
        new[name] = value
    new.use_relative = old.use_relative
    new.eval_time = old.eval_time


def _write_normals(mesh: bpy.types.Mesh, refined: Refined) -> Iterator[None]:
    for layer in refined.layers:
        if layer.kind == "NORMAL":
            # Free normals stay as they are where a rig or a shape key turns the surface.
            turns = refined.groups.shape[1] > 0 or len(refined.offsets) > 0
            if bpy.app.version >= FREE_NORMALS and not turns:
                normals = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER")
                normals.data.foreach_set("vector", _flat(layer.values, np.float32))
            else:
                mesh.update()
                mesh.normals_split_custom_set(layer.values.astype(np.float32))
            yield


def _choose_as(mesh: bpy.types.Mesh, source: bpy.types.Mesh) -> None:
    """Mark the same UV maps, colours and attribute as the active ones."""
    for before in source.uv_layers:
        after = mesh.uv_layers.get(before.name)
        if after is not None:
            after.active_render, after.active_clone = before.active_render, before.active_clone
    attributes = mesh.attributes
    for name in ("active_color_name", "default_color_name"):
        if getattr(source.attributes, name) in attributes:
            setattr(attributes, name, getattr(source.attributes, name))
    for old, new in ((source.uv_layers, mesh.uv_layers), (source.attributes, attributes)):
        if old.active is not None and old.active.name in new:
            new.active = new[old.active.name]


def _flat(values: np.ndarray, dtype: type) -> np.ndarray:
    return np.ascontiguousarray(values, dtype).ravel()
