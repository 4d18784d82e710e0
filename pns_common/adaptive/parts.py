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
# Names of vertices that are followed and never written.
UNNAMED = 2**48


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

    @property
    def lasting(self) -> bool:
        """True where creases and soft edges stay as they are down to the last level."""
        return self.sharp is None or self.sharp >= self.deepest

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
        return self._refined(replace(part, exists=split), touched, first_name)

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
        names, finer = part.names[moving], replace(part, exists=np.zeros_like(part.exists))
        while finer.depth < self.deepest:
            active = marked(moving, finer.topology.vertex_count)
            finer, step, _ = self._refined(finer, active, UNNAMED)
            steps.append(step)
            order = np.argsort(finer.names)
            moving = order[np.searchsorted(finer.names, names, sorter=order)]
        return [*made, self._settled(finer, moving, steps)]

    def _settled(
        self, part: Part, rows: Integer[np.ndarray, " N"], steps: Sequence[Refined]
    ) -> Settled:
        limits = limit_positions(part.points, part.topology, self.blocks, self.base)[rows]
        return Settled(part.names[rows], steps, part.topology, rows, part.points, limits)

    def _refined(
        self, part: Part, active: Bool[np.ndarray, " V"], first_name: int
    ) -> tuple[Part, Refined, Integer[np.ndarray, " E"]]:
        """Refine what surrounds some vertices, and keep what surrounds them and new ones."""
        near, vertices, edges = part.of_faces(
            np.logical_or.reduce(active[part.topology.faces], axis=1)
        )
        mesh, count = near.topology, near.topology.vertex_count
        names = first_name + np.arange(len(mesh.edges))
        topology = self.base.split(mesh, self.blocks, inherit=self.inherit(part.depth + 1))
        finer = Part(
            part.depth + 1,
            topology,
            self.base.place(near.points, mesh, self.blocks),
            np.concatenate([near.names, names]),
            (CHILDREN * near.codes[:, None] + np.arange(CHILDREN)).reshape(-1),
            np.repeat(near.exists, CHILDREN),
        )
        seen = marked(topology.faces[finer.exists], topology.vertex_count)
        seen[:count] |= active[vertices]
        made, kept, _ = finer.of_faces(np.logical_or.reduce(seen[topology.faces], axis=1))
        of_edges = np.full(len(part.topology.edges), NOT_THERE, dtype=np.int64)
        of_edges[edges] = names
        return made, Refined(vertices, mesh, kept), of_edges


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
    made = made.with_creases(np.flatnonzero(mesh.edge_class[edges] == connectivity.CREASE))
    if len(mesh.soft):
        soft = np.where(made.edge_class == connectivity.INTERIOR, mesh.soft[edges], 0.0)
        made = replace(made, soft=soft if soft.any() else NO_WEIGHTS)
    if len(mesh.vertex_sharpness):
        made = made.with_vertex_sharpness(mesh.vertex_sharpness[vertices])
    if len(mesh.soft_corners):
        made = made.with_soft_corners(mesh.soft_corners[vertices])
    return made, vertices, edges


def unsettled(mesh: Topology, levels: Levels) -> Bool[np.ndarray, " V"]:
    """Return which vertices have rules that change, or blend others, further down."""
    made = np.zeros(mesh.vertex_count, dtype=bool)
    if len(mesh.soft):
        made[mesh.edges[mesh.soft > 0]] = True
    if len(mesh.soft_corners):
        made |= (mesh.soft_corners > 0) & (mesh.soft_corners < 1)
    if len(mesh.vertex_sharpness):
        made |= (mesh.vertex_sharpness > 0) & np.isfinite(mesh.vertex_sharpness)
    if not levels.lasting:
        made[mesh.edges[mesh.crease_edges]] = True
    return made
