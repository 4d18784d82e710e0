"""Objects to refine, and what is in them as arrays."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

NAME = "bl_ext.user_default.pns_refine"
# A cube whose faces look outwards.
CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def cube(name: str = "Cube") -> bpy.types.Object:
    """A cube of quads, active and selected."""
    return placed(name, CORNERS, SIDES)


def grid(cells: int, name: str = "Grid") -> bpy.types.Object:
    """A hilly square of so many quads a side."""
    side = cells + 1
    across, along = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    points = np.stack([across, along, 0.2 * np.sin(3 * across) * np.cos(2 * along)], axis=-1)
    first = (np.arange(cells)[:, None] * side + np.arange(cells)).reshape(-1)
    quads = np.stack([first, first + side, first + side + 1, first + 1], axis=1)
    return placed(name, points.reshape(-1, 3).tolist(), quads.tolist())


def placed(name: str, points: list, faces: list, edges: list = ()) -> bpy.types.Object:
    """An object of these, active and selected."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, edges, faces)
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    chosen(obj)
    return obj


def linked(obj: bpy.types.Object, path: Path) -> bpy.types.Object:
    """The same object in an empty file, linked from a file that is written to the path."""
    name = obj.name
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects = [name]
    there = bpy.data.objects[name]
    bpy.context.scene.collection.objects.link(there)
    chosen(there)
    return there


def chosen(obj: bpy.types.Object) -> None:
    """Make it the only one that is selected, and active."""
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


def refined(obj: bpy.types.Object, **settings: object) -> bpy.types.Object:
    """The new object that the operator makes of it."""
    chosen(obj)
    assert bpy.ops.object.pns_refine(**settings) == {"FINISHED"}
    new = bpy.context.object
    assert new != obj or settings.get("keep_original") is False
    assert not new.data.validate(verbose=True), "Blender had to repair the mesh"
    return new


def points_of(mesh: bpy.types.Mesh) -> np.ndarray:
    """The vertices (V, 3)."""
    return numbers(mesh.vertices, "co", 3)


def numbers(rows: bpy.types.bpy_prop_collection, field: str, width: int = 1) -> np.ndarray:
    """A field of all rows, (N, width)."""
    values = np.empty(len(rows) * width, np.float32)
    rows.foreach_get(field, values)
    return values.reshape(-1, width).astype(np.float64)


def triangles_of(mesh: bpy.types.Mesh) -> np.ndarray:
    """The triangles (T, 3) that Blender cuts the faces into."""
    mesh.calc_loop_triangles()
    return numbers(mesh.loop_triangles, "vertices", 3).astype(np.int64)


def evaluated(obj: bpy.types.Object) -> bpy.types.Mesh:
    """The mesh with all modifiers."""
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
