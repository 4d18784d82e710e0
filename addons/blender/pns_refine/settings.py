"""Settings of the operator and of live mode."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from pns_common import load_model
from pns_common.carry.charts import Linear
from pns_common.model.file import COMPANIONS, DEFAULT_MODEL, bundled_models
from pns_common.model.session import OnnxModel

from .refining.compute import Choice

NO_ANGLE = math.pi
# The property that each choice of detail asks for.
GOAL_OF = {"LEVELS": "levels", "FACES": "max_faces", "TOLERANCE": "tolerance", "ANGLE": "angle"}
# Rules of boundaries by the names of Blender's Subdivision Surface.
BORDERS = {"ALL": "smooth", "PRESERVE_CORNERS": "corners"}
# What stays linear of UV maps, by its names and by ours.
UV_KEPT: dict[str, Linear] = {
    "NONE": "all",
    "PRESERVE_CORNERS": "corners only",
    "PRESERVE_BOUNDARIES": "boundaries",
    "SMOOTH_ALL": "none",
}
# Since 5.0 a path says whether it may begin at the folder of the file, "//".
PATH_OPTIONS = {"ANIMATABLE"}
if bpy.app.version >= (5, 0, 0):
    PATH_OPTIONS |= {"PATH_SUPPORTS_BLEND_RELATIVE"}
BUDGET = load_model(DEFAULT_MODEL).card.budget


@lru_cache(maxsize=4)
def _loaded(source: str, stamp: float) -> OnnxModel:
    """Load a model once; ``stamp`` changes where its file does."""
    return load_model(Path(source) if stamp else source)


def model_of(name: str, file: str) -> OnnxModel:
    """Return the model of a file, or the bundled one of this name.

    Raises:
        ModelError: there is no such file, or it is no model.
    """
    if not file:
        return _loaded(name, 0.0)
    path = Path(bpy.path.abspath(file))
    return _loaded(str(path), path.stat().st_mtime) if path.is_file() else load_model(path)


def _model_changed(settings: bpy.types.bpy_struct, context: bpy.types.Context) -> None:
    if not settings.model_file:
        settings.budget = model_of(settings.model, "").card.budget


class Settings:
    """The properties; a class with them is registered with Blender as an operator or a group."""

    detail: EnumProperty(
        name="Detail",
        description="Where faces are cut",
        items=(
            ("LEVELS", "Everywhere", "Each face as often as Levels says"),
            ("FACES", "Faces at Most", "Where the surface bends most, up to a number of faces"),
            (
                "TOLERANCE",
                "Tolerance",
                "Where faces would be farther from the smooth surface than "
                "a share of the mesh's size",
            ),
            ("ANGLE", "Angle", "Where shading turns more than an angle. For triangles alone"),
        ),
        default="LEVELS",
    )
    max_faces: IntProperty(
        name="Faces at Most",
        description="The most faces of each mesh; at least as many as it has",
        default=20_000,
        min=1,
        soft_min=100,
        soft_max=1_000_000,
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="How far faces may be from the smooth surface, as a share of the diagonal of "
        "the mesh's box",
        subtype="PERCENTAGE",
        default=0.1,
        min=0.001,
        soft_max=5.0,
        max=100.0,
        precision=3,
    )
    angle: FloatProperty(
        name="Angle",
        description="How far shading may turn over a face",
        subtype="ANGLE",
        default=math.radians(10),
        min=math.radians(0.1),
        max=math.radians(179),
    )
    levels: IntProperty(
        name="Levels",
        description="How often each face is cut: polygons into quads, triangles into four",
        default=2,
        min=1,
        max=6,
    )
    scheme: EnumProperty(
        name="Scheme",
        description="How new vertices are placed",
        items=(
            (
                "PNS",
                "PNS",
                "Catmull–Clark, or Loop for triangles alone, with a small, learned correction",
            ),
            (
                "LOOP",
                "Loop",
                "Loop subdivision without correction; polygons are cut into triangles",
            ),
        ),
        default="PNS",
    )
    model: EnumProperty(
        name="Model",
        description="The learned correction",
        items=[(name, name, f"The bundled model {name}") for name in bundled_models()],
        default=DEFAULT_MODEL,
        update=_model_changed,
    )
    model_file: StringProperty(
        name="Model File",
        description="A model file to use instead of a bundled model",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
    budget: FloatProperty(
        name="Budget C",
        description="How large the correction may be; 0 is the plain scheme",
        default=BUDGET,
        min=0.0,
        soft_max=max(4.0, 1.25 * BUDGET),
        max=1000.0,
        precision=3,
    )
    limit: BoolProperty(
        name="On Limit Surface",
        description="Put the vertices where further levels would take them in the end, so that "
        "more levels give a finer mesh of one shape",
        default=True,
    )
    crease_angle: FloatProperty(
        name="Crease Angle",
        description="Keep edges sharp whose faces meet at a larger angle; 180° keeps none",
        subtype="ANGLE",
        default=NO_ANGLE,
        min=0.0,
        max=NO_ANGLE,
    )
    crease_lines: BoolProperty(
        name="Keep Crease Lines",
        description="Keep edges sharp that the mesh shows to be: between flat sides and going on, "
        "or hard where most of it is shaded smooth",
        default=True,
    )
    border: EnumProperty(
        name="Boundary",
        description="How open boundaries are smoothed",
        items=(
            ("PRESERVE_CORNERS", "Keep Corners", "Smooth, but for corners that one face has alone"),
            ("ALL", "All", "Smooth, corners too"),
        ),
        default="ALL",
    )
    uv_smooth: EnumProperty(
        name="UV Smooth",
        description="Which points of UV maps stay in their places",
        items=(
            ("NONE", "None", "All stay, and edges stay straight"),
            ("PRESERVE_CORNERS", "Keep Corners", "Corners of a patch that one face has alone"),
            ("PRESERVE_BOUNDARIES", "Keep Boundaries", "The borders of patches"),
            ("SMOOTH_ALL", "All", "None stays: borders are smoothed too"),
        ),
        default="PRESERVE_BOUNDARIES",
    )

    def draw_settings(self, layout: bpy.types.UILayout) -> None:
        """Show the properties."""
        layout.prop(self, "detail")
        layout.prop(self, GOAL_OF[self.detail])
        layout.prop(self, "scheme")
        column = layout.column()
        column.enabled = self.scheme == "PNS"
        column.prop(self, "model")
        column.prop(self, "model_file")
        column.prop(self, "budget", slider=True)
        layout.prop(self, "limit")
        column = layout.column()
        column.enabled = self.scheme == "PNS"
        column.prop(self, "crease_lines")
        layout.prop(self, "crease_angle")
        layout.prop(self, "border")
        layout.prop(self, "uv_smooth")


def keeps_polygons(settings: Settings) -> bool:
    """Return whether polygons become quads; for a model file they count as triangles."""
    return settings.scheme == "PNS" and not settings.model_file and settings.model in COMPANIONS


def choice_of(settings: Settings) -> Choice:
    """Return what was chosen, without Blender.

    Raises:
        PnsError: the model cannot be used.
    """
    learned = settings.scheme == "PNS"
    angle = settings.crease_angle
    return Choice(
        model=model_of(settings.model, settings.model_file) if learned else None,
        levels=settings.levels,
        budget=settings.budget,
        limit=settings.limit,
        crease_angle=None if angle >= NO_ANGLE else angle,
        crease_lines=settings.crease_lines,
        border=BORDERS[settings.border],
        uv_keep=UV_KEPT[settings.uv_smooth],
        tolerance=f"{settings.tolerance}%" if settings.detail == "TOLERANCE" else None,
        angle=math.degrees(settings.angle) if settings.detail == "ANGLE" else None,
        max_faces=settings.max_faces if settings.detail == "FACES" else None,
    )
