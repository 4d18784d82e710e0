"""Measure how long the interface stands still while a large mesh is refined.

PYTHON addons/blender/measure.py ZIP      # `make blender-measure`; prints figures and judges none

PYTHON has bpy; ZIP is the extension as `make addon` writes it.
"""

from __future__ import annotations

import sys
import time

import bpy
import numpy as np

# Vertices along each side of the sheet, for 100,000 faces; seconds between two ticks of the timer.
SIDE, TICK = 224, 0.02
GROUPS, KEYS, RUNS = 10, 5, 3


def main(zip_file: str) -> None:
    """Install the extension, make the mesh, and time both schemes."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        repo="user_default", filepath=zip_file, enable_on_install=True
    )
    obj = sheet()
    for name in "LOOP", "PNS":
        pieces = sorted(longest_pieces(obj, name) for _ in range(RUNS))
        print(
            f"{name}: {len(obj.data.polygons):,} faces, one level beside the interface: it stands "
            f"still for at most {1000 * pieces[RUNS // 2]:.0f} ms "
            f"({1000 * pieces[0]:.0f} to {1000 * pieces[-1]:.0f})"
        )


def longest_pieces(obj: bpy.types.Object, scheme: str) -> float:
    """Drive the operator as Blender's timer does; the longest that a tick took, or came too late.

    What it takes to give the result to an object is in the last tick. A tick is late where the
    thread that computes does not let go of the interpreter.
    """
    from bl_ext.user_default.pns_refine.operator import place
    from bl_ext.user_default.pns_refine.run import Run, Share, key_of, refine_meshes
    from bl_ext.user_default.pns_refine.settings import choice_of

    asked = obj.data.pns_live
    asked.scheme, asked.levels, asked.limit, asked.crease_lines = scheme, 1, False, False
    run = Run(refine_meshes([obj], choice_of(asked), Share()))
    longest, done = 0.0, False
    while not done:
        began = time.perf_counter()
        done = run.advance()
        if done:
            new = place(obj, run.value[key_of(obj.data)], True)
            bpy.context.view_layer.update()
        longest = max(longest, time.perf_counter() - began)
        began = time.perf_counter()
        time.sleep(TICK)
        longest = max(longest, time.perf_counter() - began - TICK)
    bpy.data.meshes.remove(new.data)
    return longest


def sheet() -> bpy.types.Object:
    """Make a wavy sheet of triangles with vertex groups, shape keys and a UV map."""
    across, along = np.meshgrid(np.linspace(-1, 1, SIDE), np.linspace(-1, 1, SIDE))
    points = np.stack([across, along, 0.2 * np.sin(5 * across) * np.cos(4 * along)], -1)
    points = points.reshape(-1, 3)
    corner = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    mesh = bpy.data.meshes.new("sheet")
    mesh.from_pydata(points, [], faces)
    mesh.uv_layers.new(name="UV")
    obj = bpy.data.objects.new("sheet", mesh)
    bpy.context.scene.collection.objects.link(obj)
    for number in range(GROUPS):
        group = obj.vertex_groups.new(name=f"group {number}")
        group.add(range(number, len(points), 3), 0.1 * (number + 1), "REPLACE")
    obj.shape_key_add(name="basis")
    for number in range(KEYS):
        key = obj.shape_key_add(name=f"key {number}")
        moved = points + [0, 0, 0.05 * (number + 1)] * np.cos((number + 1) * points[:, :1])
        key.data.foreach_set("co", moved.astype(np.float32).reshape(-1))
    return obj


if __name__ == "__main__":
    main(sys.argv[1])
