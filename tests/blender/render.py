"""Import GLBs into Blender side by side, play a clip, render one frame. Needs bpy's Python.

python render.py OUT.png FRAME FILE.glb...     # prints what Blender made of each file, as JSON
"""

import json
import math
import sys
from pathlib import Path

import bpy
from mathutils import Vector

SAMPLES = 24
WIDTH, HEIGHT = 840, 420
GAP = 0.15
# From the scene towards the eye, z up.
VIEW = Vector((0.8, -1.0, 0.45))


def main(output, frame, files):
    """Render `files` from left to right."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    groups = [imported(path) for path in files]
    scene = bpy.context.scene
    scene.frame_set(frame)
    right = VIEW.cross(Vector((0, 0, -1))).normalized()
    place, found = 0.0, []
    for objects in groups:
        corners = evaluated(objects)
        along = [corner.dot(right) for corner in corners]
        shift = right * (place - min(along))
        for root in (o for o in objects if o.parent is None):
            root.matrix_world.translation += shift
        place += (max(along) - min(along)) * (1 + GAP)
        found.append(described(objects))
    bpy.context.view_layer.update()
    scene.frame_set(frame)
    look_at([corner for objects in groups for corner in evaluated(objects)], right)
    light()
    render(Path(output))
    print(json.dumps(found))


def imported(path):
    """The objects of a file."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(path), disable_bone_shape=True)
    objects = [o for o in bpy.data.objects if o not in before]
    for o in objects:
        if o.type == "MESH":
            o.data.update()
    return objects


def evaluated(objects):
    """The vertices of all meshes, in the world, as this frame has them."""
    graph = bpy.context.evaluated_depsgraph_get()
    return [
        shown.matrix_world @ vertex.co
        for shown in (o.evaluated_get(graph) for o in objects if o.type == "MESH")
        for vertex in shown.data.vertices
    ]


def described(objects):
    """What Blender made of a file."""
    meshes = [o for o in objects if o.type == "MESH"]
    corners = evaluated(objects)
    keys = [o.data.shape_keys for o in meshes if o.data.shape_keys]
    return {
        "faces": sum(len(o.data.polygons) for o in meshes),
        "bones": sum(len(o.data.bones) for o in objects if o.type == "ARMATURE"),
        "groups": sum(len(o.vertex_groups) for o in meshes),
        "keys": [[(b.name, round(b.value, 4)) for b in k.key_blocks] for k in keys],
        "size": [max(c[k] for c in corners) - min(c[k] for c in corners) for k in range(3)],
    }


def look_at(corners, right):
    """An orthographic camera that sees all corners."""
    toward = VIEW.normalized()
    up = toward.cross(right)
    spans = [(min(c.dot(a) for c in corners), max(c.dot(a) for c in corners)) for a in (right, up)]
    across, along = (sum(span) / 2 for span in spans)
    centre = right * across + up * along
    depth = max(c.dot(toward) for c in corners)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    wide, tall = (high - low for low, high in spans)
    camera.data.ortho_scale = 1.08 * max(wide, tall * WIDTH / HEIGHT)
    reach = wide + tall
    camera.location = centre + toward * (depth + reach)
    camera.data.clip_end = 10 * reach
    camera.rotation_euler = toward.to_track_quat("Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def light():
    """A sun over the left shoulder, and a grey sky."""
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle = 1.6, math.radians(3)
    sun.rotation_euler = (math.radians(50), 0, math.radians(15))
    bpy.context.scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.8, 0.85, 0.9, 1)
    world.node_tree.nodes["Background"].inputs[1].default_value = 0.35
    bpy.context.scene.world = world


def render(output):
    """One frame by Cycles on the processor: the only engine that needs no graphics card."""
    bpy.ops.preferences.addon_enable(module="cycles")
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples, scene.cycles.seed = SAMPLES, 0
    scene.cycles.use_denoising = True
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.compression = 100
    scene.render.filepath = str(output)
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3:])
