"""Variants of one control mesh: itself, Loop, an untrained control, and the learned operator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import radians

import bmesh
import bpy
import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh, Refinement, load_model, loop, pns, refine
from pns_common.carry.carried import Column, refine_column
from pns_common.parallel import Blocks
from pns_common.schemes.limit import limit_normals, limit_positions
from pns_common.schemes.loop import LOOP

# Triangles of one polygon turn by less; and quads that are joined of two bend and lean by less.
FLAT, LEAN = radians(0.1), radians(40)


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh to show, and what is known at its vertices.

    ``smooth`` says how it is shaded, but along its ``sharp`` edges.
    """

    title: str
    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    smooth: bool
    fields: dict[str, Float[np.ndarray, " V"]]
    sharp: Int[np.ndarray, "N 2"] = field(default_factory=lambda: np.empty((0, 2), np.int64))


def control(mesh: Mesh, levels: int, model: str | None) -> Shape:
    """Return the control mesh, its faces flat."""
    return Shape("Control mesh", mesh.vertices, mesh.faces, False, {})


def loop_surface(mesh: Mesh, levels: int, model: str | None) -> Shape:
    """Refine by Loop's rules."""
    made = refine(mesh, loop(), levels).mesh
    return Shape("Loop", made.vertices, made.faces, True, {})


def subsurf_surface(mesh: Mesh, levels: int, model: str | None) -> Shape:
    """Put Blender's Subdivision Surface on the polygons that the triangles were cut from."""
    data = bpy.data.meshes.new("subsurf")
    data.from_pydata(mesh.vertices, [], mesh.faces.tolist())
    edited = bmesh.new()
    edited.from_mesh(data)
    bmesh.ops.dissolve_limit(edited, angle_limit=FLAT, verts=[], edges=edited.edges)
    bmesh.ops.join_triangles(
        edited, faces=edited.faces, angle_face_threshold=LEAN, angle_shape_threshold=LEAN
    )
    edited.to_mesh(data)
    edited.free()
    obj = bpy.data.objects.new("subsurf", data)
    bpy.context.scene.collection.objects.link(obj)
    obj.modifiers.new("subsurf", "SUBSURF").levels = levels
    shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points, polygons = (np.array([[*v.co] for v in shown.vertices]), shown.polygons)
    faces = Mesh(points, [[*polygon.vertices] for polygon in polygons]).triangulated().faces
    bpy.data.meshes.remove(data)
    return Shape("Subdivision Surface", points, faces, True, {})


def pushed_surface(mesh: Mesh, levels: int, model: str | None) -> Shape:
    """Make N1: push each vertex once along its normal by what Loop takes in; then Loop."""
    surface = mesh.topology(), Blocks(), LOOP
    taken = mesh.vertices - limit_positions(mesh.vertices, *surface)
    normals = limit_normals(mesh.vertices, *surface).vertices
    heights = (taken * normals).sum(axis=1, keepdims=True)
    pushed = Mesh(mesh.vertices + heights * normals, mesh.faces)
    return _beside_loop("N1, untrained", refine(pushed, loop(), levels), mesh, levels, {})


def learned_surface(mesh: Mesh, levels: int, model: str | None) -> Shape:
    """Refine by the learned operator, with the proximity ratio of its last learned level."""
    scheme = pns(load_model(model))
    made = refine(mesh, scheme, levels)
    learned = min(levels, scheme.learned_levels or levels)
    added = made.steps[learned - 1].added
    assert added is not None
    # Later levels are Loop's: new vertices have the mean of the edge's ends.
    ratio = refine_column(Column(added.ratio), made.topologies[learned:], LOOP)
    return _beside_loop("PNS", made, mesh, levels, {"ratio": ratio})


VARIANTS: dict[str, Callable[[Mesh, int, str | None], Shape]] = {
    "control": control,
    "loop": loop_surface,
    "subsurf": subsurf_surface,
    "n1": pushed_surface,
    "pns": learned_surface,
}


def _beside_loop(
    title: str, made: Refinement, mesh: Mesh, levels: int, fields: dict[str, np.ndarray]
) -> Shape:
    plain, points = refine(mesh, loop(), levels), made.mesh.vertices
    distance = np.linalg.norm(points - plain.mesh.vertices, axis=1)
    last = made.scheme.base.split(made.topologies[-1], Blocks())
    sharp = last.edges[last.is_sharp].astype(np.int64)
    return Shape(title, points, made.mesh.faces, True, {"distance": distance, **fields}, sharp)
