"""Objects to refine, what Blender's timer does with those that are live, and arrays of both."""

import json

import bpy
import numpy as np
from bl_ext.user_default.pns_refine.live_watch import WATCH

CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def cube(name="Cube"):
    return placed(name, CORNERS, SIDES)


def grid(cells, name="Grid"):
    """A hilly square of so many quads a side."""
    steps, side = np.linspace(-1, 1, cells + 1), cells + 1
    points = [(x, y, 0.2 * np.sin(3 * x) * np.cos(2 * y)) for x in steps for y in steps]
    firsts = [i * side + j for i in range(cells) for j in range(cells)]
    return placed(name, points, [(f, f + side, f + side + 1, f + 1) for f in firsts])


def placed(name, points, faces, edges=()):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, edges, faces)
    mesh.update()
    return shown_here(bpy.data.objects.new(name, mesh))


def shown_here(obj):
    bpy.context.scene.collection.objects.link(obj)
    return chosen(obj)


def linked(obj, path):
    """The same object in an empty file, linked from a file that is written to the path."""
    name = obj.name
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects = [name]
    return shown_here(bpy.data.objects[name])


def chosen(obj):
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def rigged(obj, **bones):
    """A rig that moves the object by groups of these bones' names, each at its x."""
    rig = shown_here(bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig")))
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (x, weight) in bones.items():
        bone = rig.data.edit_bones.new(name)
        bone.head, bone.tail = (x, 0, 0), (x, 0, 1)
        group = obj.vertex_groups.new(name=name)
        for vertex in obj.data.vertices:
            group.add([vertex.index], weight(vertex.co.x), "REPLACE")
    bpy.ops.object.mode_set(mode="OBJECT")
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    return rig


def refined(obj, **settings):
    """The new object that the operator makes of it."""
    chosen(obj)
    assert bpy.ops.object.pns_refine(**settings) == {"FINISHED"}
    new = bpy.context.object
    assert new != obj or settings.get("keep_original") is False
    assert not new.data.validate(verbose=True), "Blender had to repair the mesh"
    return new


def notes(obj):
    return "\n".join(json.loads(obj.data.pns_result.notes))


def points_of(mesh):
    return numbers(mesh.vertices, "co", 3)


def numbers(rows, field="value", width=1):
    """A field of all rows, (N, width)."""
    values = np.empty(len(rows) * width, np.float32)
    rows.foreach_get(field, values)
    return values.reshape(-1, width).astype(np.float64)


def evaluated(obj):
    bpy.context.view_layer.update()
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data


def started(obj, **settings):
    """The object, live, with these settings."""
    chosen(obj)
    assert bpy.ops.object.pns_live_add() == {"FINISHED"}
    for name, value in settings.items():
        setattr(obj.data.pns_live, name, value)
    if settings:
        bpy.ops.object.pns_live_refresh()
    return obj


def edit(obj, settled=True):
    """Lift a vertex of the mesh, and let the timer follow."""
    obj.data.vertices[7].co.z += 1
    obj.data.update()
    if settled:
        settle()


def settle():
    """Run at once what Blender's timer does in the seconds after an edit."""
    for _ in range(100):
        # As Blender does between two ticks: what a refresh changes is no edit.
        bpy.context.view_layer.update()
        if WATCH.run is not None:
            WATCH.run.finish()
        if WATCH.advance(quiet=0) is None:
            return
    raise AssertionError("it never settles")
