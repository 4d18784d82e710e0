"""Sentences on data that a refinement changes or drops, for the report panel."""

from __future__ import annotations

import bpy

from pns_common.carry import rules

from .attributes import KINDS, STRUCTURE
from .reading import Reading
from .refining.snapshot import Refined
from .words import listed

# Modifiers that remember the mesh they were bound to, by the name of the flag that says so.
BOUND = {
    "SURFACE_DEFORM": "is_bound",
    "MESH_DEFORM": "is_bound",
    "LAPLACIANDEFORM": "is_bind",
    "CORRECTIVE_SMOOTH": "is_bind",
}
SIMULATED = {"CLOTH", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT", "OCEAN"}


def losses(obj: bpy.types.Object, reading: Reading, refined: Refined) -> list[str]:
    """Tell in sentences all that an object's mesh loses, or has only in part, when refined."""
    mesh: bpy.types.Mesh = obj.data
    return [
        *_of_faces(reading, refined),
        *_of_attributes(mesh, reading),
        *_of_normals(mesh),
        *_of_groups(reading),
        *_of_keys(mesh),
        *_of_modifiers(obj),
    ]


def _of_faces(reading: Reading, refined: Refined) -> list[str]:
    said = []
    if reading.snapshot.has_polygons and refined.topology.triangles:
        said.append("Faces of more than three corners became triangles")
    loose = int((~reading.snapshot.edge_used).sum())
    if loose:
        said.append(f"{loose:,} edges without faces are kept as they are, not refined")
    return said


def _of_attributes(mesh: bpy.types.Mesh, reading: Reading) -> list[str]:
    said = []
    layers = [layer for layer in reading.snapshot.layers if not layer.name.startswith(".")]
    voted = [layer.name for layer in layers if layer.rule is rules.vote]
    if voted:
        said.append(f"New points and corners have the value of most parents: {listed(voted)}")
    own = {"sharp_edge", "bevel_weight_edge", "uv_seam", "freestyle_edge"}
    edges = [x.name for x in layers if x.domain == "EDGE" and x.name not in own]
    if edges:
        said.append(f"Edges new inside faces have the value zero: {listed(edges)}")
    unknown = [
        attribute.name
        for attribute in mesh.attributes
        if attribute.data_type not in KINDS and attribute.name not in STRUCTURE
    ]
    if unknown:
        said.append(f"Lost, of types that are not known: {listed(unknown)}")
    if len(mesh.skin_vertices):
        said.append("Lost: radii of the Skin modifier")
    return said


def _of_normals(mesh: bpy.types.Mesh) -> list[str]:
    if not mesh.has_custom_normals:
        return []
    return ["Custom normals are rebuilt from those of the corners around"]


def _of_groups(reading: Reading) -> list[str]:
    if not reading.empty_members:
        return []
    return [f"{reading.empty_members:,} members of vertex groups with weight 0 are none any more"]


def _of_keys(mesh: bpy.types.Mesh) -> list[str]:
    key = mesh.shape_keys
    if key is None:
        return []
    said = ["Shape keys are refined by the scheme's masks; the correction is the basis's"]
    if not key.use_relative:
        said.append("Absolute shape keys are evenly spaced in time again")
    return said


def _of_modifiers(obj: bpy.types.Object) -> list[str]:
    said = []
    bound = [m.name for m in obj.modifiers if m.type in BOUND and getattr(m, BOUND[m.type])]
    if bound:
        said.append(f"To be bound again: {listed(bound)}")
    if any(m.type == "MULTIRES" for m in obj.modifiers):
        said.append("Lost: what was sculpted with the Multiresolution modifier")
    hooks = [m.name for m in obj.modifiers if m.type == "HOOK"]
    if hooks:
        said.append(f"Hooks move the old vertices alone: {listed(hooks)}")
    if obj.particle_systems:
        said.append("Particles and hair are to be placed again")
    simulated = [m.name for m in obj.modifiers if m.type in SIMULATED]
    if simulated:
        said.append(f"To be baked again: {listed(simulated)}")
    return said


def subdividing_modifiers(obj: bpy.types.Object) -> list[str]:
    """Return the names of the Subdivision Surface modifiers that act in the viewport or renders."""
    return [
        m.name
        for m in obj.modifiers
        if m.type == "SUBSURF"
        and ((m.show_viewport and m.levels) or (m.show_render and m.render_levels))
    ]


def irregularities(refined: Refined) -> list[str]:
    """Return what was found of the mesh when it was refined."""
    said = []
    levels = refined.report["levels"]
    edges = levels[0]["edges"]["irregular"] if levels else 0
    if edges:
        said.append(f"{edges:,} edges join more than two faces, or turned ones, and are sharp")
    split = refined.split_vertices
    if split:
        said.append(f"{split:,} border vertices lie on others: Merge by Distance would join them")
    return said
