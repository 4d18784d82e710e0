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
# Marks of edges for which zero is no loss.
OWN_EDGES = {"sharp_edge", "bevel_weight_edge", "uv_seam", "freestyle_edge"}
SIMULATED = {"CLOTH", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT", "OCEAN"}


def losses(obj: bpy.types.Object, reading: Reading, refined: Refined) -> list[str]:
    """Tell in sentences all that an object's mesh loses, or has only in part, when refined."""
    mesh, snapshot, key = obj.data, reading.snapshot, obj.data.shape_keys
    layers = [layer for layer in snapshot.layers if not layer.name.startswith(".")]
    voted = [layer.name for layer in layers if layer.rule is rules.vote]
    edges = [x.name for x in layers if x.domain == "EDGE" and x.name not in OWN_EDGES]
    unknown = [
        attribute.name
        for attribute in mesh.attributes
        if attribute.data_type not in KINDS and attribute.name not in STRUCTURE
    ]
    kinds = {modifier.type for modifier in obj.modifiers}
    bound = [m.name for m in obj.modifiers if m.type in BOUND and getattr(m, BOUND[m.type])]
    hooks = [m.name for m in obj.modifiers if m.type == "HOOK"]
    simulated = [m.name for m in obj.modifiers if m.type in SIMULATED]
    loose, empty = int((~snapshot.edge_used).sum()), reading.empty_members
    levels, split = refined.report["levels"], refined.split_vertices
    irregular = levels[0]["edges"]["irregular"] if levels else 0
    told = (
        (
            snapshot.has_polygons and refined.topology.triangles,
            "Faces of more than three corners became triangles",
        ),
        (
            mesh.uv_layers and "adaptive" in refined.report,
            "UV maps are straight in every face, whatever UV Smooth says",
        ),
        (loose, f"{loose:,} edges without faces are kept as they are, not refined"),
        (voted, f"New points and corners have the value of most parents: {listed(voted)}"),
        (edges, f"Edges new inside faces have the value zero: {listed(edges)}"),
        (unknown, f"Lost, of types that are not known: {listed(unknown)}"),
        (len(mesh.skin_vertices), "Lost: radii of the Skin modifier"),
        (
            mesh.has_custom_normals,
            "Custom normals are rebuilt from those of the corners around",
        ),
        (empty, f"{empty:,} members of vertex groups with weight 0 are none any more"),
        (key, "Shape keys are refined by the scheme's masks; the correction is the basis's"),
        (
            key and not key.use_relative,
            "Absolute shape keys are evenly spaced in time again",
        ),
        (bound, f"To be bound again: {listed(bound)}"),
        ("MULTIRES" in kinds, "Lost: what was sculpted with the Multiresolution modifier"),
        (hooks, f"Hooks move the old vertices alone: {listed(hooks)}"),
        (obj.particle_systems, "Particles and hair are to be placed again"),
        (simulated, f"To be baked again: {listed(simulated)}"),
        (
            irregular,
            f"{irregular:,} edges join more than two faces, or turned ones, and are sharp",
        ),
        (
            split,
            f"{split:,} border vertices lie on others: Merge by Distance would join them",
        ),
    )
    return [text for holds, text in told if holds]


def subdividing_modifiers(obj: bpy.types.Object) -> list[str]:
    """Return the names of the Subdivision Surface modifiers that act in the viewport or renders."""
    return [
        m.name
        for m in obj.modifiers
        if m.type == "SUBSURF"
        and ((m.show_viewport and m.levels) or (m.show_render and m.render_levels))
    ]
