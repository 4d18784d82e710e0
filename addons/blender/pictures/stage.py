"""The stage: one orthographic camera, one sun, one sky; the same for every picture."""

from __future__ import annotations

import math
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

# From the scene towards the eye, z up.
VIEW = Vector((0.8, -1.0, 0.45)).normalized()
# The picture's axes: right, up, and towards the eye.
RIGHT = Vector((0, 0, 1)).cross(VIEW).normalized()
UP = VIEW.cross(RIGHT)
SUN, SKY = 1.7, 0.36


def clear() -> None:
    """Begin with nothing."""
    bpy.ops.wm.read_factory_settings(use_empty=True)


def at(across: float, along: float, depth: float = 0.0) -> Vector:
    """Return the point that lies there in the picture."""
    return RIGHT * across + UP * along + VIEW * depth


def facing() -> Matrix:
    """Return a turn that lets a flat thing face the eye."""
    return Matrix((RIGHT, UP, VIEW)).transposed().to_4x4()


def camera(width: float, height: float, middle: Vector | None = None) -> None:
    """Look at a rectangle around a point, the origin if none is given."""
    eye = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    eye.data.type = "ORTHO"
    eye.data.ortho_scale = max(width, height)
    reach = 50 * max(width, height)
    eye.data.clip_end = 10 * reach
    place = VIEW * reach + (middle or Vector())
    eye.matrix_world = Matrix.Translation(place) @ facing()
    bpy.context.scene.collection.objects.link(eye)
    bpy.context.scene.camera = eye


def light() -> None:
    """Put up a sun over the left shoulder, a grey sky, and white paper behind."""
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle = SUN, math.radians(6)
    towards = at(-0.55, 0.65, 0.75)
    sun.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    tree = world.node_tree
    sky = tree.nodes["Background"]
    sky.inputs["Color"].default_value = (0.82, 0.87, 0.95, 1)
    sky.inputs["Strength"].default_value = SKY
    paper, mix = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeMixShader")
    paper.inputs["Color"].default_value = (1, 1, 1, 1)
    rays = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(rays.outputs["Is Camera Ray"], mix.inputs["Fac"])
    tree.links.new(sky.outputs["Background"], mix.inputs[1])
    tree.links.new(paper.outputs["Background"], mix.inputs[2])
    tree.links.new(mix.outputs["Shader"], tree.nodes["World Output"].inputs["Surface"])
    bpy.context.scene.world = world


def picture(output: Path, width: int, height: int, samples: int) -> None:
    """Render a picture of so many pixels, always with the same seed and colours as they are.

    It has a temporary name first, so that nobody sees half of it.
    """
    bpy.ops.preferences.addon_enable(module="cycles")
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_denoising = samples, 0, True
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage, scene.render.use_stamp = 100, False
    scene.view_settings.view_transform = "Standard"
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.compression = "PNG", "RGB", 100
    temporary = output.with_name(f"{output.stem}.tmp.png").resolve()
    scene.render.filepath = str(temporary)
    bpy.ops.render.render(write_still=True)
    temporary.replace(output)
    print(f"{output}: {width} × {height}")
