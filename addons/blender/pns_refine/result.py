"""Record of a refinement, kept on the mesh that it made."""

from __future__ import annotations

import json

import bpy
import numpy as np
from bpy.props import FloatProperty, StringProperty

from . import words
from .refining.snapshot import Refined
from .writing import SHOWN


class PNS_PG_result(bpy.types.PropertyGroup):  # noqa: N801 (Blender's names)
    """The report, the notes, the largest values of what the overlays show, and live mode's digest.

    The digest changes with the mesh that this one was made from, and with what was asked for.
    """

    report: StringProperty()
    notes: StringProperty()
    pns_ratio: FloatProperty()
    pns_gate: FloatProperty()
    pns_distance: FloatProperty()
    digest: StringProperty()


def remember(mesh: bpy.types.Mesh, refined: Refined, notes: list[str]) -> None:
    """Write the report and notes of a refinement on its mesh."""
    result = mesh.pns_result
    result.report, result.notes = json.dumps(refined.report), json.dumps(notes)
    for name, values in zip(SHOWN, (refined.ratio, refined.gate, refined.distance), strict=True):
        setattr(result, name, float(values.max(initial=0)))


def certificate_lines(
    obj: bpy.types.Object, mesh: bpy.types.Mesh, scene: bpy.types.Scene
) -> list[str]:
    """Return the certificate of a refined mesh in the scene's units, as the object is scaled."""
    report = json.loads(mesh.pns_result.report)
    scale = largest_scale(obj)
    return words.certificate(
        report, mesh.pns_result.pns_distance, lambda x: in_units(x * scale, scene)
    )


def largest_scale(obj: bpy.types.Object) -> float:
    """Return how much an object stretches its mesh at most, sheared by its parents or not."""
    return float(np.linalg.norm(np.array(obj.matrix_world.to_3x3()), 2))


def in_units(length: float, scene: bpy.types.Scene) -> str:
    """Return a length as the scene's units word it."""
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{length:.4g}"
    return bpy.utils.units.to_string(
        units.system, "LENGTH", length * units.scale_length, precision=4
    )
