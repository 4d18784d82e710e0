"""A Blender mesh as a snapshot of arrays, read in pieces that do not hold up the interface."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import bpy
import numpy as np

from .attributes import read_layers
from .refining.creases import crease_sharpness_of
from .refining.shading import normals_layer, switch
from .refining.snapshot import Layer, Snapshot

# Rows of vertex weights that are read at once: about twenty milliseconds.
ROWS = 2_000
FREESTYLE = "FREESTYLE"


@dataclass(frozen=True)
class Group:
    """A vertex group: its name, and whether its weights are locked."""

    name: str
    lock_weight: bool


@dataclass(frozen=True, eq=False)
class Reading:
    """A mesh as arrays, with what else must be known of it to write it again.

    ``empty_members`` counts vertices that are in a vertex group with weight 0.
    """

    snapshot: Snapshot
    groups: tuple[Group, ...]
    key_names: tuple[str, ...]
    empty_members: int


def read_mesh(mesh: bpy.types.Mesh) -> Generator[None, None, Reading]:
    """Read a mesh; yields between pieces, and returns the reading."""
    starts = np.append(_ints(mesh.polygons, "loop_start", 1)[:, 0], len(mesh.loops))
    sizes = np.diff(starts)
    # Attributes are copied as a block; other properties are read one by one.
    corners = np.arange(len(mesh.loops)).reshape(-1, 3) if (sizes == 3).all() else _cut(mesh)
    triangles = _ints(mesh.attributes[".corner_vert"].data, "value", 1)[:, 0][corners]
    polygons = np.repeat(np.arange(len(sizes)), sizes - 2)
    edges = _ints(mesh.attributes[".edge_verts"].data, "value", 2)
    yield
    layers: list[Layer] = []
    for layer in read_layers(mesh):
        if layer is not None:
            layers.append(layer)
        yield
    layers += _freestyle(mesh)
    if mesh.has_custom_normals:
        layers.append(normals_layer(_floats(mesh.corner_normals, "vector", 3)))
    yield
    groups, empty = yield from _weights(mesh)
    offsets = np.zeros((0, len(mesh.vertices), 3))
    points, keys = _floats(mesh.vertices, "co", 3), ()
    if mesh.shape_keys is not None:
        blocks = mesh.shape_keys.key_blocks
        points = _floats(mesh.shape_keys.reference_key.points, "co", 3)
        offsets = np.stack([_floats(block.points, "co", 3) - points for block in blocks])
        keys = tuple(block.name for block in blocks)
    snapshot = Snapshot(
        points=points,
        triangles=triangles,
        corners=corners,
        polygons=polygons,
        polygon_corners=starts,
        edges=edges,
        crease_sharpness=crease_sharpness_of(_creases(mesh, "crease_edge", len(mesh.edges))),
        vertex_sharpness=crease_sharpness_of(_creases(mesh, "crease_vert", len(mesh.vertices))),
        groups=groups,
        offsets=offsets,
        layers=tuple(layers),
    )
    return Reading(snapshot, _groups(mesh), keys, empty)


def _cut(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the corners (T, 3) of the triangles that polygons are cut into, in their order."""
    mesh.calc_loop_triangles()
    return _ints(mesh.loop_triangles, "loops", 3)


def _groups(mesh: bpy.types.Mesh) -> tuple[Group, ...]:
    """Return the vertex groups of a mesh, which only objects that have it can tell."""
    holder = next((o for o in bpy.data.objects if o.data == mesh), None)
    if holder is None:
        return ()
    return tuple(Group(group.name, group.lock_weight) for group in holder.vertex_groups)


def _weights(mesh: bpy.types.Mesh) -> Generator[None, None, tuple[np.ndarray, int]]:
    """Read the weights of all vertex groups, (V, G), and the number of memberships of weight 0."""
    weights = np.zeros((len(mesh.vertices), len(_groups(mesh))))
    empty = 0
    if weights.shape[1] == 0:
        return weights, empty
    for start in range(0, len(mesh.vertices), ROWS):
        rows, columns, values = [], [], []
        for row, vertex in enumerate(mesh.vertices[start : start + ROWS], start):
            for member in vertex.groups:
                rows.append(row)
                columns.append(member.group)
                values.append(member.weight)
        inside = np.asarray(columns) < weights.shape[1]
        shares = np.asarray(values)
        weights[np.asarray(rows, int)[inside], np.asarray(columns, int)[inside]] = shares[inside]
        empty += int((shares == 0).sum())
        yield
    return weights, empty


def _creases(mesh: bpy.types.Mesh, name: str, count: int) -> np.ndarray:
    attribute = mesh.attributes.get(name)
    return np.zeros(count) if attribute is None else _floats(attribute.data, "value", 1)[:, 0]


def _freestyle(mesh: bpy.types.Mesh) -> list[Layer]:
    """Read Freestyle's marks, where they are no attributes."""
    layers = []
    for rows, domain in ((mesh.edges, "EDGE"), (mesh.polygons, "FACE")):
        name = f"freestyle_{domain.lower()}"
        if name in mesh.attributes or not rows or not hasattr(rows[0], "use_freestyle_mark"):
            continue
        marks = np.zeros(len(rows), np.bool_)
        rows.foreach_get("use_freestyle_mark", marks)
        if marks.any():
            layers.append(replace(switch(name, domain, marks), kind=FREESTYLE))
    return layers


def _ints(rows: bpy.types.bpy_prop_collection, field: str, width: int) -> np.ndarray:
    values = np.empty(len(rows) * width, np.int32)
    rows.foreach_get(field, values)
    return values.reshape(-1, width).astype(np.int64)


def _floats(rows: bpy.types.bpy_prop_collection, field: str, width: int) -> np.ndarray:
    values = np.empty(len(rows) * width, np.float32)
    rows.foreach_get(field, values)
    return values.reshape(-1, width).astype(np.float64)
