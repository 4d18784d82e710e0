"""Import GLBs into Blender side by side, play a clip, render one frame. Needs bpy's Python.

python render.py OUT.png FRAME FILE.glb...     # prints what Blender made of each file, as JSON
"""

import json
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addons.blender.pictures import stage

SAMPLES = 24
WIDTH, HEIGHT = 840, 420
GAP, MARGIN = 0.15, 1.08


def main(output, frame, files):
    """Render `files` from left to right."""
    stage.clear()
    groups = [imported(path) for path in files]
    scene = bpy.context.scene
    scene.frame_set(frame)
    place, descriptions = 0.0, []
    for objects in groups:
        corners = evaluated(objects)
        along = [corner.dot(stage.RIGHT) for corner in corners]
        shift = stage.RIGHT * (place - min(along))
        for root in (o for o in objects if o.parent is None):
            root.matrix_world.translation += shift
        place += (max(along) - min(along)) * (1 + GAP)
        descriptions.append(described(objects))
    bpy.context.view_layer.update()
    scene.frame_set(frame)
    look_at([corner for objects in groups for corner in evaluated(objects)])
    stage.light()
    stage.picture(Path(output), WIDTH, HEIGHT, SAMPLES)
    print(json.dumps(descriptions))


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
    """Return what Blender made of a file."""
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


def look_at(corners):
    """Let the camera see all corners."""
    axes = (stage.RIGHT, stage.UP)
    spans = [(min(c.dot(a) for c in corners), max(c.dot(a) for c in corners)) for a in axes]
    wide, tall = (high - low for low, high in spans)
    middle = [sum(span) / 2 for span in spans]
    size = MARGIN * max(wide, tall * WIDTH / HEIGHT)
    stage.camera(size, size * HEIGHT / WIDTH, stage.at(*middle))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3:])
