"""Meshes out of files that Blender reads, welded by position."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import bpy
import numpy as np

from pns_common import Mesh, clean

READERS = {
    ".obj": bpy.ops.wm.obj_import,
    ".ply": bpy.ops.wm.ply_import,
    ".stl": bpy.ops.wm.stl_import,
    ".glb": bpy.ops.import_scene.gltf,
    ".gltf": bpy.ops.import_scene.gltf,
}
# Blender's own meshes, by these words in place of a path.
MADE = {
    "suzanne": bpy.ops.mesh.primitive_monkey_add,
    "cube": bpy.ops.mesh.primitive_cube_add,
    "cylinder": partial(bpy.ops.mesh.primitive_cylinder_add, vertices=16),
    "cone": partial(bpy.ops.mesh.primitive_cone_add, vertices=16),
}


def read(path: Path) -> Mesh:
    """Read the triangles of a file, or of a mesh of Blender's own; vertices in one place are one.

    Raises:
        SystemExit: Blender has no reader for it, or there is nothing in it.
    """
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return welded(arrays["vertices"], arrays["faces"])
    before = set(bpy.data.objects)
    if str(path) in MADE:
        MADE[str(path)]()
    elif path.suffix.lower() in READERS:
        READERS[path.suffix.lower()](filepath=str(path))
    else:
        raise SystemExit(f"{path}: not one of {', '.join([*READERS, '.npz'])}")
    objects = [o for o in bpy.data.objects if o not in before and o.type == "MESH"]
    if not objects:
        raise SystemExit(f"{path}: no mesh in it")
    points, faces, count = [], [], 0
    for obj in objects:
        obj.data.calc_loop_triangles()
        matrix = np.array(obj.matrix_world)
        vertices = _numbers(obj.data.vertices, "co", np.float32) @ matrix[:3, :3].T + matrix[:3, 3]
        points.append(vertices)
        faces.append(_numbers(obj.data.loop_triangles, "vertices", np.int32) + count)
        count += len(vertices)
    for obj in set(bpy.data.objects) - before:
        bpy.data.objects.remove(obj)
    return welded(np.concatenate(points), np.concatenate(faces))


def welded(points: np.ndarray, faces: np.ndarray) -> Mesh:
    """Join vertices at the same place, and leave degenerate faces out."""
    _, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    joined = place[number.reshape(-1)][faces]
    return clean(Mesh(points[np.sort(first)], joined)).mesh


def _numbers(rows: bpy.types.bpy_prop_collection, field: str, dtype: type) -> np.ndarray:
    values = np.empty(3 * len(rows), dtype)
    rows.foreach_get(field, values)
    return values.reshape(-1, 3)
