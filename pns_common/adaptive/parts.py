"""Parts of refined levels: faces, with what their masks read around them.

A level of a refinement is a mesh whose faces are the children of all faces of the level before. A
part holds some of its faces. Those that exist, as children of split faces, have all around them
that is there in the whole level, so the scheme's masks, limits and normals at their vertices are
those of the whole level. What lies further out is not read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.kernels import connectivity
from pns_common.mesh.rows import marked
from pns_common.mesh.topology import NO_WEIGHTS, Topology, build_topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.limit import limit_positions

NOT_THERE = -1
CHILDREN = 4
# The weights of a face's corners at the corners of its children.
CHILD_WEIGHTS = 0.5 * np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[0, 2, 0], [0, 1, 1], [1, 1, 0]],
        [[0, 0, 2], [1, 0, 1], [0, 1, 1]],
        [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
    ]
)


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a level.

    Attributes:
        depth: the level; that of the control mesh is 0.
        topology, points: its mesh; ``points`` are control points.
        names: (V,) numbers of its vertices that are the same at every level.
        codes: (F,) numbers of its faces, ascending: that of child k of face c is 4 c + k.
        exists: (F,) faces that are children of split faces; others surround them.
    """

    depth: int
    topology: Topology
    points: Float[np.ndarray, "V 3"]
    names: Integer[np.ndarray, " V"]
    codes: Integer[np.ndarray, " F"]
    exists: Bool[np.ndarray, " F"]

    def of_faces(
        self, kept: Bool[np.ndarray, " F"]
    ) -> tuple[Part, Integer[np.ndarray, " W"], Integer[np.ndarray, " E"]]:
        """Return some of the faces; and which of the part's vertices and edges theirs are."""
        if kept.all():
            return self, np.arange(len(self.points)), np.arange(len(self.topology.edges))
        topology, vertices, edges = cut_out(self.topology, kept)
        part = Part(
            self.depth,
            topology,
            self.points[vertices],
            self.names[vertices],
            self.codes[kept],
            self.exists[kept],
        )
        return part, vertices, edges


@dataclass(frozen=True, eq=False)
class Refined:
    """One step from a part to one of the next level, for what its vertices carry.

    Attributes:
        vertices: vertices of the first part that are read.
        topology: their mesh.
        kept: of the vertices that the masks make of these, those of the second part.
    """

    vertices: Integer[np.ndarray, " U"]
    topology: Topology
    kept: Integer[np.ndarray, " W"]


@dataclass(frozen=True, eq=False)
class Settled:
    """Vertices of a part that are put on the limit.

    Attributes:
        names: the vertices.
        steps: the steps down to where their masks no longer change.
        topology: the mesh there.
        rows: their rows in it.
        points: control points there.
        limits: (N, 3) where they end.
    """

    names: Integer[np.ndarray, " N"]
    steps: Sequence[Refined]
    topology: Topology
    rows: Integer[np.ndarray, " N"]
    points: Float[np.ndarray, "V 3"]
    limits: Float[np.ndarray, "N 3"]


@dataclass(frozen=True)
class Levels:
    """The rules of all levels.

    Attributes:
        base: the base scheme.
        blocks: how work is shared.
        deepest: the last level.
        sharp: so many levels keep creases and soft edges; None: all.
    """

    base: BaseScheme
    blocks: Blocks
    deepest: int
    sharp: int | None

    def lasts(self, depth: int) -> bool:
        """Return whether creases and soft edges of a level stay as they are, or are gone."""
        return self.sharp is None or self.sharp >= self.deepest or depth >= self.sharp

    def inherit(self, depth: int) -> bool:
        """Return whether the edges of a level are as sharp as those they are halves of."""
        return depth >= self.deepest or self.sharp is None or depth < self.sharp

    def split(
        self, part: Part, split: Bool[np.ndarray, " F"], first_name: int
    ) -> tuple[Part, Refined, Integer[np.ndarray, " E"]]:
        """Return the part of the next level in which the children of some faces exist.

        Return also the name of the vertex that each edge of ``part`` gets there, from
        ``first_name`` on, or NOT_THERE.
        """
        touched = marked(part.topology.faces[split], part.topology.vertex_count)
        around = np.logical_or.reduce(touched[part.topology.faces], axis=1)
        near, vertices, edges = replace(part, exists=split).of_faces(around)
        mesh = near.topology
        names = first_name + np.arange(len(mesh.edges))
        finer = Part(
            part.depth + 1,
            self.base.split(mesh, self.blocks, inherit=self.inherit(part.depth + 1)),
            self.base.place(near.points, mesh, self.blocks),
            np.concatenate([near.names, names]),
            (CHILDREN * near.codes[:, None] + np.arange(CHILDREN)).reshape(-1),
            np.repeat(near.exists, CHILDREN),
        )
        of_edges = np.full(len(part.topology.edges), NOT_THERE, dtype=np.int64)
        of_edges[edges] = names
        return finer, Refined(vertices, mesh, np.arange(len(finer.names))), of_edges

    def settle(self, part: Part, rows: Integer[np.ndarray, " N"]) -> list[Settled]:
        """Put vertices of faces that exist on the limit.

        They end where the refinement of the whole mesh down to the deepest level puts them. A
        vertex whose rules are the same at all levels is put there at once; others are followed.
        """
        moves = np.zeros(len(rows), dtype=bool)
        if part.depth < self.deepest:
            moves = unsettled(part.topology, self)[rows]
        made = list[Settled]()
        if not moves.all():
            made.append(self._settled(part, rows[~moves], []))
        if not moves.any():
            return made
        moving, steps = rows[moves], list[Refined]()
        mesh, vertices = stars(part.topology, moving)
        points, every, first = part.points[vertices], vertices, np.arange(len(moving))
        # The neighbours of a centre are the ends of the first half of its edges, a level later.
        far = mesh.edges.max(axis=1)
        spokes = np.flatnonzero(mesh.edges.min(axis=1) < len(moving))
        kept = np.arange(mesh.vertex_count)
        kept[far[spokes]] = mesh.vertex_count + spokes
        for depth in range(part.depth, self.deepest):
            steps.append(Refined(every, mesh, kept))
            points, every = self.base.place(points, mesh, self.blocks)[kept], np.arange(len(kept))
            mesh = later(mesh, inherit=self.inherit(depth + 1))
        limits = limit_positions(points, mesh, self.blocks, self.base)[first]
        return [*made, Settled(part.names[moving], steps, mesh, first, points, limits)]

    def _settled(
        self, part: Part, rows: Integer[np.ndarray, " N"], steps: Sequence[Refined]
    ) -> Settled:
        limits = limit_positions(part.points, part.topology, self.blocks, self.base)[rows]
        return Settled(part.names[rows], steps, part.topology, rows, part.points, limits)


def cut_out(
    mesh: Topology, kept: Bool[np.ndarray, " F"]
) -> tuple[Topology, Integer[np.ndarray, " W"], Integer[np.ndarray, " E"]]:
    """Return some faces of a mesh with their sharpness, and their vertices and edges in it.

    An edge of which not all faces are kept has the class that the others leave it.
    """
    corners = mesh.faces[kept]
    used = marked(corners, mesh.vertex_count)
    vertices, number = np.flatnonzero(used), (np.cumsum(used) - 1).astype(np.uint32)
    made = build_topology(number[corners], len(vertices))
    edges = np.empty(len(made.edges), dtype=np.int64)
    edges[made.corner_edges] = mesh.face_edges[kept].reshape(-1)
    return with_rules_of(mesh, made, vertices, edges), vertices, edges


def with_rules_of(
    mesh: Topology,
    made: Topology,
    vertices: Integer[np.ndarray, " W"],
    edges: Integer[np.ndarray, " E"],
) -> Topology:
    """Return a topology with the sharpness of a mesh, where its vertices and edges are known."""
    made = made.with_creases(np.flatnonzero(mesh.edge_class[edges] == connectivity.CREASE))
    if len(mesh.soft):
        soft = np.where(made.edge_class == connectivity.INTERIOR, mesh.soft[edges], 0.0)
        made = replace(made, soft=soft if soft.any() else NO_WEIGHTS)
    if len(mesh.wear):
        whole = made.edge_class != connectivity.BOUNDARY
        wear = np.where(whole, mesh.wear[edges], 0.0)
        found = np.where(wear > 0, mesh.found[edges], 0.0) if len(mesh.found) else NO_WEIGHTS
        made = replace(made, wear=wear if wear.any() else NO_WEIGHTS, found=found)
    if len(mesh.vertex_sharpness):
        made = made.with_vertex_sharpness(mesh.vertex_sharpness[vertices])
    if len(mesh.soft_corners):
        made = made.with_soft_corners(mesh.soft_corners[vertices])
    return made


def stars(
    mesh: Topology, rows: Integer[np.ndarray, " N"]
) -> tuple[Topology, Integer[np.ndarray, " W"]]:
    """Return the faces around each of some vertices as a mesh, and which vertices its own are.

    No two vertices share a face there. The given ones come first.
    """
    number = np.full(mesh.vertex_count, -1)
    number[rows] = np.arange(len(rows))
    corners = np.flatnonzero(number[mesh.corners] >= 0)
    at, star = (
        np.stack(
            [
                corners,
                corners - corners % 3 + (corners + 1) % 3,
                corners - corners % 3 + (corners + 2) % 3,
            ],
            1,
        ),
        number[mesh.corners[corners]],
    )
    keys = star[:, None] * mesh.vertex_count + mesh.corners[at[:, 1:]]
    ring, of_corner = np.unique(keys, return_inverse=True)
    faces = np.column_stack([star, len(rows) + of_corner.reshape(-1, 2)])
    vertices = np.concatenate([rows, ring % mesh.vertex_count])
    made = build_topology(faces.astype(np.uint32), len(vertices))
    edges = np.empty(len(made.edges), dtype=np.int64)
    edges[made.corner_edges] = mesh.corner_edges[at].reshape(-1)
    return with_rules_of(mesh, made, vertices, edges), vertices


def later(mesh: Topology, *, inherit: bool) -> Topology:
    """Return the same stars with the sharpness that they have a level later."""
    if inherit and not len(mesh.wear) and not len(mesh.vertex_sharpness):
        return mesh
    made = mesh
    if not inherit:
        weights = mesh.soft_corners_of_split(mesh.vertex_count, inherit=False)
        made = replace(mesh.without_creases(), soft_corners=weights)
    made = replace(made, vertex_sharpness=mesh.worn_vertices(mesh.vertex_count))
    halves = np.arange(len(mesh.edges))[:, None].repeat(2, axis=1)
    # What wears off does so whatever becomes of other edges.
    return made.worn(mesh, halves, inherit=inherit)


def unsettled(mesh: Topology, levels: Levels) -> Bool[np.ndarray, " V"]:
    """Return which vertices have rules that change, or blend others, further down."""
    made = np.zeros(mesh.vertex_count, dtype=bool)
    if len(mesh.soft):
        made[mesh.edges[mesh.soft > 0]] = True
    if len(mesh.wear):
        made[mesh.edges[(mesh.wear > 0) & np.isfinite(mesh.wear)]] = True
    if len(mesh.soft_corners):
        made |= (mesh.soft_corners > 0) & (mesh.soft_corners < 1)
    if len(mesh.vertex_sharpness):
        made |= (mesh.vertex_sharpness > 0) & np.isfinite(mesh.vertex_sharpness)
    if not levels.lasts(0):
        made[mesh.edges[mesh.crease_edges]] = True
    return made
