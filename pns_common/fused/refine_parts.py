"""Go through the levels with many small meshes at once, as parts of one that share no vertex.

What a kernel or a network's call costs beside its rows is then paid once, not for each mesh. Each
part keeps its own unit of length and its own report, and has the bits that it would have alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import Creases
from pns_common.connectivity.topology import Topology
from pns_common.fused.kernels.normals import HELD, flipped_children, largest_jump
from pns_common.fused.kernels.together import TOGETHER
from pns_common.fused.learned.learned_step import learned_points
from pns_common.fused.levels.level import FusedLevel, control_level, crease_shift_of, next_level
from pns_common.fused.levels.loop_points import largest_size, loop_points
from pns_common.fused.levels.mesh_edges import MeshEdges, split_mesh_faces
from pns_common.geometry.child_faces import ChildAngles, angle_of_chord
from pns_common.levels.diagnostics import LevelReport, level_report
from pns_common.levels.refined_levels import check_coordinates
from pns_common.levels.step import AddedStep
from pns_common.mesh import Mesh
from pns_common.rules.placement import without_correction
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class RefinedParts:
    """The last level's mesh with its diagnostics, and for each part the reports of all levels.

    ``multi_fan_vertices`` counts, for each part, control vertices with more than one fan.
    ``split_topology`` is of the mesh that the last level split, built where it is asked for.
    """

    points: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    ratio: Float[np.ndarray, " V"]
    gate: Float[np.ndarray, " V"]
    reports: list[list[LevelReport]]
    multi_fan_vertices: list[int]
    split_topology: Callable[[], Topology]


@dataclass(frozen=True, eq=False)
class Units:
    """What each of P parts is measured by: R, and s of the prior; 0 where there is none."""

    lengths: Float[np.ndarray, " P"]
    strengths: Float[np.ndarray, " P"]

    def of(
        self, part_of: Int[np.ndarray, " V"]
    ) -> tuple[Float[np.ndarray, " V"], Float[np.ndarray, " V"]]:
        """Return both for each vertex."""
        return self.lengths[part_of], self.strengths[part_of]


@dataclass(frozen=True, eq=False)
class _Connectivity:
    """A part's own, as far as its report asks."""

    vertex_count: int
    faces: Int[np.ndarray, "F 3"]
    edge_class: Int[np.ndarray, " E"]
    interior: Int[np.ndarray, " I"]


@dataclass(frozen=True, eq=False)
class _Parts:
    """Where the P parts lie in a level: each one's faces and edges follow those of the one before.

    Attributes:
        faces, edges: (P + 1,) where each begins.
        of_vertex: (V,) the part of each vertex; parts are mixed there, below the first level.
    """

    faces: Int[np.ndarray, " Q"]
    edges: Int[np.ndarray, " Q"]
    of_vertex: Int[np.ndarray, " V"]

    @property
    def count(self) -> int:
        return len(self.faces) - 1

    def next(self) -> _Parts:
        """Return the same of the next level, but for its edges."""
        of_edge = np.repeat(np.arange(self.count), np.diff(self.edges))
        return replace(self, faces=4 * self.faces, of_vertex=np.r_[self.of_vertex, of_edge])

    def with_edges_of(self, mesh: MeshEdges) -> _Parts:
        """Find the parts' edges: numbered as they first appear over faces, they lie as those do."""
        edges = np.searchsorted(mesh.half_edges[:, 0] // 3, self.faces)
        return replace(self, edges=edges)


def refine_parts_fused(
    mesh: Mesh,
    part_faces: Int[np.ndarray, " Q"],
    scheme: Scheme,
    levels: int,
    units: Units,
    creases: Creases,
    blocks: Blocks,
) -> RefinedParts:
    """Refine all parts; ``part_faces`` says where the faces of each begin, and where the last end.

    Raises:
        ParameterError: a crease is no edge.
        ModelError: a network returned something that is not finite, or of another shape.
        MeshError: the refined coordinates are too large.
    """
    level = control_level(mesh.vertices, mesh.faces, creases, blocks)
    of_vertex = np.zeros(len(mesh.vertices), dtype=np.int64)
    count = len(part_faces) - 1
    of_vertex[mesh.faces] = np.repeat(np.arange(count), np.diff(part_faces))[:, None]
    parts = _Parts(part_faces, part_faces, of_vertex)
    multi_fan_vertices = np.bincount(of_vertex[level.multi_fan_vertices], minlength=count)

    reports: list[list[LevelReport]] = [[] for _ in range(count)]
    points, step = mesh.vertices, None
    for depth in range(levels):
        if step is not None:
            sharp = creases.sharp_at(depth)
            level, parts = next_level(level, points, blocks, sharp=sharp), parts.next()
        parts = parts.with_edges_of(level.mesh)
        points, counterpart, step = _placed(level, parts, scheme, units, depth, blocks)
        check_coordinates(largest_size(points, blocks))
        for part, report in enumerate(_reports(level, parts, points, counterpart, step)):
            reports[part].append(report)
    assert step is not None  # levels ≥ 1
    return RefinedParts(
        points=points,
        faces=split_mesh_faces(level.mesh, np.int64, blocks),
        ratio=np.concatenate([step.vertices.ratio, step.edges.ratio]),
        gate=np.concatenate([step.vertices.gate, step.edges.gate]),
        reports=reports,
        multi_fan_vertices=multi_fan_vertices.tolist(),
        split_topology=level.topology,
    )


def _placed(
    level: FusedLevel,
    parts: _Parts,
    scheme: Scheme,
    units: Units,
    depth: int,
    blocks: Blocks,
) -> tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 3"] | None, AddedStep]:
    """Return the next level's points, Loop's (None: no child can be flipped), and the step."""
    if scheme.acts_at(depth):
        # What overflows under an absurd budget is caught by the caller.
        with np.errstate(over="ignore", invalid="ignore"):
            length, strength = units.of(parts.of_vertex)
            made = learned_points(level, scheme, length, blocks, strength)
        return made.points, made.counterpart, made.step
    level.faces.forget()
    points, count = loop_points(level.points, level.mesh, blocks), level.mesh.vertex_count
    step = AddedStep(
        without_correction(points[:count]), without_correction(points[count:]), False, None
    )
    return points, None, step


def _reports(
    level: FusedLevel,
    parts: _Parts,
    points: Float[np.ndarray, "W 3"],
    counterpart: Float[np.ndarray, "W 3"] | None,
    step: AddedStep,
) -> list[LevelReport]:
    """Return what ``level_report`` says of each part."""
    mesh, shifts = level.mesh, _crease_shifts(level, parts, points)
    children = _children(mesh, parts, points, counterpart)
    order = np.argsort(parts.of_vertex, kind="stable")
    starts = np.searchsorted(parts.of_vertex[order], np.arange(parts.count + 1))
    vertices, edges = step.vertices.rows(order), step.edges
    guard = None
    if step.guard is not None:
        guard = step.guard[: mesh.vertex_count][order], step.guard[mesh.vertex_count :]
    inside = np.searchsorted(mesh.interior, parts.edges)
    reports: list[LevelReport] = []
    for part in range(parts.count):
        own_vertices = slice(starts[part], starts[part + 1])
        own_edges = slice(parts.edges[part], parts.edges[part + 1])
        own = _Connectivity(
            vertex_count=int(starts[part + 1] - starts[part]),
            faces=mesh.faces[parts.faces[part] : parts.faces[part + 1]],
            edge_class=mesh.edge_class[own_edges],
            interior=mesh.interior[inside[part] : inside[part + 1]] - own_edges.start,
        )
        scales = None
        if guard is not None:
            scales = np.concatenate([guard[0][own_vertices], guard[1][own_edges]])
        its = AddedStep(vertices.rows(own_vertices), edges.rows(own_edges), step.learned, scales)
        reports.append(level_report(own, its, children[part], shifts[part]))
    return reports


def _crease_shifts(
    level: FusedLevel, parts: _Parts, points: Float[np.ndarray, "W 3"]
) -> list[float | None]:
    """Return the longest way from smooth of each part's vertices at creases; None without."""
    shift = crease_shift_of(level)(points)
    if shift is None:
        return [None] * parts.count
    of_edge = np.searchsorted(parts.edges, shift.edges, side="right") - 1
    longest = np.zeros(parts.count)
    np.maximum.at(longest, parts.of_vertex[shift.vertices], shift.of_vertices)
    np.maximum.at(longest, of_edge, shift.of_edges)
    creased = np.bincount(of_edge, minlength=parts.count) > 0
    return [float(longest[part]) if creased[part] else None for part in range(parts.count)]


def _children(
    mesh: MeshEdges,
    parts: _Parts,
    points: Float[np.ndarray, "W 3"],
    counterpart: Float[np.ndarray, "W 3"] | None,
) -> list[ChildAngles]:
    """Return what ``look_at_children`` sees of each part."""
    faces, edges = (mesh.faces, mesh.face_edges), (mesh.half_edges, mesh.edge_class)
    count, seen = mesh.vertex_count, list[ChildAngles]()
    held = np.empty(HELD * TOGETHER)
    for part in range(parts.count):
        at_faces = parts.faces[part : part + 2]
        # What is across an edge of a part is of that part.
        jump = largest_jump(points, *faces, *edges, count, *at_faces, np.zeros(1), held)
        flipped = 0
        if counterpart is not None:
            flipped = flipped_children(points, counterpart, *faces, count, *at_faces)
        seen.append(ChildAngles(int(flipped), angle_of_chord(jump)))
    return seen
