"""A level as the compiled kernels see it, and its Loop step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import marked, norm
from pns_common.base.blocks import Blocks
from pns_common.base.cached import cached_property
from pns_common.connectivity.creases import Creases, crease_classes, crease_halves
from pns_common.connectivity.topology import EdgeClass, Topology, vertices_across
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.child_faces import look_at_children
from pns_common.fused.levels.crease_lines import crease_line_rows
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.fused.levels.fans import multi_fan_vertices
from pns_common.fused.levels.loop_points import largest_size, loop_points, place_vertices
from pns_common.fused.levels.mesh_edges import MeshEdges, build_edges, in_int32, split_mesh_edges
from pns_common.geometry.crease_lines.held_edges import with_held_edges
from pns_common.levels.diagnostics import Displacements, LevelReport, edge_counts
from pns_common.masks.crease_shift import CreaseShift, shift_of_edges
from pns_common.mesh import LARGEST_COORDINATE

# Far more than the sums of Loop's masks are wrong by.
ROUNDING = 1 + 1e-6


@dataclass(frozen=True, eq=False)
class FusedLevel:
    """One level's mesh, before refinement."""

    points: Float[np.ndarray, "V 3"]
    mesh: MeshEdges
    blocks: Blocks
    faces: FaceMeasures

    @classmethod
    def of(cls, points: Float[np.ndarray, "V 3"], mesh: MeshEdges, blocks: Blocks) -> FusedLevel:
        """Return a mesh's level, of whose faces nothing is known yet."""
        return cls(points, mesh, blocks, FaceMeasures(points, mesh.faces, blocks.unheard()))

    @cached_property
    def multi_fan_vertices(self) -> Bool[np.ndarray, " V"]:
        """Whether the faces of each vertex form more than one fan."""
        return multi_fan_vertices(self.mesh, self.blocks.unheard())

    def topology(self) -> Topology:
        """Return the same connectivity as the array kernels keep it."""
        return topology_of(self.mesh)


@dataclass(frozen=True, eq=False)
class FusedStep:
    """What a step made of a level; the faces follow from the level's edges.

    No absolute coordinate is above ``largest``, which is NaN where one is, and above
    LARGEST_COORDINATE only where one is. ``added`` is None for Loop. ``report`` looks at the step
    when it is called.
    """

    points: Float[np.ndarray, "W 3"]
    largest: float
    report: Callable[[], LevelReport]
    added: Additions | None


def control_level(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Creases,
    blocks: Blocks,
) -> FusedLevel:
    """Return the level of a control mesh.

    Raises:
        ParameterError: a crease is no edge of the mesh.
    """
    mesh = control_edges(faces, len(points), creases.named, blocks)
    level = FusedLevel.of(points, mesh, blocks)
    if creases.line_angle is not None:
        normals = level.faces.normals
        lines = crease_line_rows(points, mesh, normals, creases, blocks.unheard())
        rows = with_held_edges(points, normals, mesh, lines)
        if len(rows):
            classes = mesh.edge_class.copy()
            classes[rows] = EdgeClass.CREASE
            level = replace(level, mesh=replace(mesh, edge_class=classes))
    return level


def next_level(
    level: FusedLevel, points: Float[np.ndarray, "W 3"], blocks: Blocks, *, sharp: bool = True
) -> FusedLevel:
    """Return the level whose points a step has placed; ``sharp`` as in ``next_edges``."""
    return FusedLevel.of(points, next_edges(level.mesh, blocks, sharp=sharp), blocks)


def control_edges(
    faces: Int[np.ndarray, "F 3"],
    vertex_count: int,
    creases: Int[np.ndarray, "N 2"] | None,
    blocks: Blocks,
) -> MeshEdges:
    """Return the edges of a control mesh.

    Raises:
        ParameterError: a crease is no edge of the mesh.
    """
    return _with_creases(build_edges(in_int32(faces, blocks), vertex_count, blocks), creases)


def next_edges(mesh: MeshEdges, blocks: Blocks, *, sharp: bool) -> MeshEdges:
    """Return the edges of the split mesh; children of creases are creases, unless they end here."""
    if not sharp:
        return split_mesh_edges(_without_creases(mesh), blocks)
    # Where the edges were split by arithmetic their classes were too.
    creases = None if mesh.plain else crease_halves(mesh.edges, mesh.edge_class, mesh.vertex_count)
    return _with_creases(split_mesh_edges(mesh, blocks), creases)


def topology_of(mesh: MeshEdges) -> Topology:
    """Return the same connectivity as the array kernels keep it."""
    faces, edges = mesh.faces.astype(np.int64), mesh.edges.astype(np.int64)
    opposed = (mesh.edge_class == EdgeClass.INTERIOR) | (mesh.edge_class == EdgeClass.CREASE)
    half_edges = np.where(opposed[:, None], mesh.half_edges, np.int64(-1))
    stencil = np.full((len(edges), 4), -1, dtype=np.int64)
    stencil[:, :2] = edges
    rows = np.flatnonzero(opposed)
    stencil[rows, 2:] = vertices_across(faces, edges[rows], half_edges[rows])
    return Topology(
        vertex_count=mesh.vertex_count,
        faces=faces,
        edges=edges,
        face_edges=mesh.face_edges.astype(np.int64),
        half_edges=half_edges,
        stencil=stencil,
        edge_class=mesh.edge_class,
        interior=mesh.interior.astype(np.int64),
    )


def loop_step(level: FusedLevel, blocks: Blocks) -> FusedStep:
    """Place a level's vertices where Loop does."""
    level.faces.forget()
    points = loop_points(level.points, level.mesh, blocks)
    # All of Loop's masks are means: its points lie among those that they are made of, a quarter as
    # many.
    largest = ROUNDING * largest_size(level.points, blocks)
    if largest > LARGEST_COORDINATE:
        largest = largest_size(points, blocks)
    mesh, shift = level.mesh, crease_shift_of(level)
    return FusedStep(
        points, largest, lambda: _loop_report(mesh, points, shift(points), blocks), None
    )


def crease_shift_of(
    level: FusedLevel,
) -> Callable[[Float[np.ndarray, "W 3"]], CreaseShift | None]:
    """Return what tells how far from smooth the points are that a level's creases became.

    None without creases: it keeps the level's points only where there are some.
    """
    points, mesh, blocks = level.points, level.mesh, level.blocks.unheard()
    rows = crease_rows(mesh)
    if len(rows) == 0:
        return lambda placed: None

    def shift(placed: Float[np.ndarray, "W 3"]) -> CreaseShift:
        smooth = np.empty_like(points)
        place_vertices(points, _without_creases(mesh), blocks, smooth)
        vertices = np.flatnonzero(marked(mesh.edges[rows].reshape(-1), len(points)))
        of_vertices = norm(np.take(placed, vertices, axis=0) - np.take(smooth, vertices, axis=0))
        connectivity = mesh.faces, mesh.edges, mesh.half_edges
        of_edges = shift_of_edges(points, *connectivity, rows, placed)
        return CreaseShift(vertices, of_vertices, rows, of_edges)

    return shift


def crease_rows(mesh: MeshEdges) -> Int[np.ndarray, " N"]:
    """Return the indices of the creases."""
    sharp = mesh.sharp_edges
    return sharp[mesh.edge_class[sharp] == EdgeClass.CREASE].astype(np.int64)


def _loop_report(
    mesh: MeshEdges, points: Float[np.ndarray, "W 3"], shift: CreaseShift | None, blocks: Blocks
) -> LevelReport:
    of_creases: Displacements = {} if shift is None else {"crease_shift_max": shift.largest}
    return {
        "vertices": len(points),
        "faces": 4 * len(mesh.faces),
        "edges": edge_counts(mesh.edge_class),
        "degenerate_frames": 0,
        "flipped_faces": 0,
        "proximity_ratio": {"max": 0.0, "mean": 0.0, "p99": 0.0},
        "gate": {"mean": 0.0, "max": 0.0, "active": 0.0},
        "normal_jump_max": look_at_children(mesh, points, None, blocks.unheard()).normal_jump_max,
        **of_creases,
    }


def _without_creases(mesh: MeshEdges) -> MeshEdges:
    rows = crease_rows(mesh)
    if len(rows) == 0:
        return mesh
    classes = mesh.edge_class.copy()
    classes[rows] = EdgeClass.INTERIOR
    return replace(mesh, edge_class=classes)


def _with_creases(mesh: MeshEdges, creases: Int[np.ndarray, "N 2"] | None) -> MeshEdges:
    if creases is None:
        return mesh
    classes = crease_classes(mesh.edges, mesh.edge_class, mesh.vertex_count, creases)
    return replace(mesh, edge_class=classes)
