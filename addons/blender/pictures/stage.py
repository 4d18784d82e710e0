"""The stage: one orthographic camera, one sun, one sky; the same for every picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

# From the scene towards the eye, z up.
VIEW = Vector((0.8, -1.0, 0.45)).normalized()
# The picture's axes: right, up, and towards the eye.
RIGHT = Vector((0, 0, 1)).cross(VIEW).normalized()
UP = VIEW.cross(RIGHT)
SUN, SKY = 1.7, 0.36


@dataclass(frozen=True)
class Quality:
    """Renderer of a picture: ``CYCLES`` or Eevee's name, and the samples of a pixel."""

    engine: str = "CYCLES"
    samples: int = 32


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


def prepare(width: int, height: int, quality: Quality) -> None:
    """Set what every picture has: as many pixels, the same seed, colours as they are."""
    scene = bpy.context.scene
    if quality.engine == "CYCLES":
        bpy.ops.preferences.addon_enable(module="cycles")
        scene.render.engine = "CYCLES"
        scene.cycles.device = "CPU"
        scene.cycles.samples, scene.cycles.seed = quality.samples, 0
        scene.cycles.use_denoising = True
    else:
        # Eevee was called otherwise for some versions.
        names = [item.identifier for item in scene.render.bl_rna.properties["engine"].enum_items]
        scene.render.engine = next(name for name in names if "EEVEE" in name)
        scene.eevee.taa_render_samples = quality.samples
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    scene.render.use_stamp = False


def picture(output: Path) -> None:
    """Render one picture; under a temporary name first, so that nobody sees half of it."""
    scene = bpy.context.scene
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.compression = 100
    temporary = output.with_name(f"{output.stem}.tmp.png").resolve()
    scene.render.filepath = str(temporary)
    bpy.ops.render.render(write_still=True)
    temporary.replace(output)


def film(output: Path, frames: int) -> None:
    """Render frames 1 to ``frames`` as a film, by the encoder that Blender comes with.

    Raises:
        SystemExit: this Blender has none.
    """
    if not bpy.app.build_options.codec_ffmpeg:
        raise SystemExit("this Blender has no encoder for films: render pictures instead")
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, frames, 24
    settings = scene.render.image_settings
    # Since 5.0 the kind is chosen before the format.
    if hasattr(settings, "media_type"):
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    coding = scene.render.ffmpeg
    coding.format, coding.codec, coding.constant_rate_factor = "MPEG4", "H264", "HIGH"
    temporary = output.with_name(f"{output.stem}.tmp.mp4").resolve()
    scene.render.use_file_extension = False
    scene.render.filepath = str(temporary)
    bpy.ops.render.render(animation=True)
    temporary.replace(output)
