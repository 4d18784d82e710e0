"""Measure the time of a refinement on a large mesh, and how long the interface stands still.

PYTHON addons/blender/measure.py ZIP      # `make blender-measure`; prints figures and judges none

PYTHON has bpy; ZIP is the extension as `make addon` writes it.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from functools import partial

import bpy
import numpy as np

# Vertices along each side of the sheet, about 100,000 in all.
SIDE = 316
GROUPS, KEYS, RUNS = 10, 5, 3
# The same for 100,000 faces, and the seconds between two ticks of the timer.
SIDE_OF_FACES, TICK = 224, 0.02


def main(zip_file: str) -> None:
    """Install, make the mesh, and time both."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        repo="user_default", filepath=zip_file, enable_on_install=True
    )
    # They come with the extension.
    from pns_common import Mesh, load_model, loop, pns, refine

    obj = sheet()
    points = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", points.reshape(-1))
    faces = np.empty(3 * len(obj.data.polygons), np.int32)
    obj.data.polygons.foreach_get("vertices", faces)
    mesh = Mesh(points.astype(np.float64), faces.reshape(-1, 3).astype(np.int64))
    for name, scheme in ("LOOP", loop()), ("PNS", pns(load_model())):
        alone = seconds(partial(refine, mesh, scheme, 1))
        whole = seconds(partial(refined, obj, name))
        print(
            f"{name}: {len(points):,} vertices, {GROUPS} groups, {KEYS} shape keys, one level: "
            f"operator {whole:.2f} s, refine {alone:.2f} s, beyond it {whole - alone:.2f} s"
        )
    obj = sheet(SIDE_OF_FACES)
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


def seconds(act: Callable[[], object]) -> float:
    """Return the median of some runs, after one that warms up."""
    act()
    spent = []
    for _ in range(RUNS):
        began = time.perf_counter()
        act()
        spent.append(time.perf_counter() - began)
    return statistics.median(spent)


def refined(obj: bpy.types.Object, scheme: str) -> None:
    """Refine a copy of the object, and throw it away."""
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.pns_refine(levels=1, scheme=scheme)
    made = bpy.context.object
    if made == obj:
        raise SystemExit("the operator made nothing")
    bpy.data.meshes.remove(made.data)


def sheet(side: int = SIDE) -> bpy.types.Object:
    """Make a wavy sheet of triangles with vertex groups, shape keys and a UV map."""
    across, along = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    points = np.stack([across, along, 0.2 * np.sin(5 * across) * np.cos(4 * along)], -1)
    points = points.reshape(-1, 3)
    corner = np.arange(side * side).reshape(side, side)
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
