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
from pns_common.mesh.topology import build_topology
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
    return _smooth("Loop", refine(mesh, loop(), levels), {})


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
    to_learned = made if learned == levels else refine(mesh, scheme, learned)
    # Later levels are Loop's: a ratio stays with the vertices that it was measured at.
    ratio = spread(to_learned.ratio, to_learned, levels - learned)
    return _beside_loop("PNS", made, mesh, levels, {"ratio": ratio})


def spread(
    values: Float[np.ndarray, " V"], made: Refinement, levels: int
) -> Float[np.ndarray, " W"]:
    """Spread values at vertices: those of later levels have the mean of the edge's ends."""
    faces, count = made.mesh.faces, len(made.mesh.vertices)
    mesh = made.mesh
    for _ in range(levels):
        topology = build_topology(faces, count)
        values = np.concatenate([values, values[topology.edges].mean(axis=1)])
        mesh = refine(mesh, loop(), 1).mesh
        faces, count = mesh.faces, len(mesh.vertices)
    return values


VARIANTS: dict[str, Callable[[Mesh, int, str | None], Shape]] = {
    "control": control,
    "loop": loop_surface,
    "subsurf": subsurf_surface,
    "n1": pushed_surface,
    "pns": learned_surface,
}


def _smooth(title: str, made: Refinement, fields: dict[str, np.ndarray]) -> Shape:
    last = made.scheme.base.split(made.topologies[-1], Blocks())
    sharp = last.edges[last.is_sharp].astype(np.int64)
    return Shape(title, made.mesh.vertices, made.mesh.faces, True, fields, sharp)


def _beside_loop(
    title: str, made: Refinement, mesh: Mesh, levels: int, fields: dict[str, np.ndarray]
) -> Shape:
    plain = refine(mesh, loop(), levels)
    distance = np.linalg.norm(made.mesh.vertices - plain.mesh.vertices, axis=1)
    return _smooth(title, made, {"distance": distance, **fields})
