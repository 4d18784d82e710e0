"""The part of a level that bends, as a mesh of its own: learned rules are evaluated there alone.

Where all faces around a vertex, or around both faces of an edge, have one and the same normal to
the last bit, as they have where a part is a plane along two axes, gates are shut and the rules add
nothing, whatever they compute. What they read elsewhere lies within two rings. Let V₀ be the ends
of all edges that bend, F₁ the faces that touch V₀, V₁ their vertices, and F₂ the faces that touch
V₁:

    open gates are those of V₀ and of edges both of whose faces are in F₁; at a boundary too, where
    a face knows its neighbours' b (formula/side_gate.py)
    they read the rings of V₁ and the sides of F₁ with its neighbours, all of which is F₂

So F₂ is cut out, in the same order, so that every sum around a vertex of V₁ is the same sum. Its
rim has lost neighbours, but no edge that bends: gates there are as shut as in the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.bent_part import (
    count_bent,
    mark_around,
    mark_bent_ends,
    mark_sides,
    number_rows,
    spread,
    take_edges,
    take_faces,
)
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.fused.levels.mesh_edges import MeshEdges

# Faces from which on cutting a part out may pay.
LEAST_FACES = 4096
# Every so-manieth edge is asked first. A prime: the edges of a grid come by threes.
STRIDE = 61
# More bent edges than this, or a larger share of the faces, and the whole is as fast.
MOST_BENT, LARGEST_PART = 0.55, 0.6


@dataclass(frozen=True, eq=False)
class Rows:
    """Which vertices, or edges, or faces of the whole are of the part.

    Attributes:
        flags: whether each is.
        numbers: where it is in the part; for others where the next one is.
        rows: those that are.
    """

    flags: Bool[np.ndarray, " N"]
    numbers: Int[np.ndarray, " N"]
    rows: Int[np.ndarray, " n"]

    @classmethod
    def of(cls, flags: Bool[np.ndarray, " N"]) -> Rows:
        """Return the marked rows, numbered."""
        numbers, rows = (np.empty(len(flags), dtype=np.int32) for _ in range(2))
        return cls(flags, numbers, rows[: number_rows(flags, numbers, rows)])

    def spread(self, added: Additions, to: Additions, blocks: Blocks) -> Bool[np.ndarray, " N"]:
        """Write what rows of the part got, nothing at others; return where that is not 0."""
        moved = np.empty(len(self.flags), dtype=bool)
        args = self.flags, self.numbers, *_values(added), ROWS, *_values(to), moved
        blocks.run(len(moved), spread.over(*args))
        return moved


@dataclass(frozen=True, eq=False)
class BentPart:
    """What is read of the part that bends, None where nothing does, and which rows it has."""

    seen: Surroundings | None
    vertices: Rows
    edges: Rows


def bent_part(whole: Surroundings) -> BentPart | None:
    """Cut out the part of a level that bends; None where that is most of it, or the mesh is small.

    Which of the two is chosen by what takes less time: the result is the same.
    """
    mesh, blocks = whole.mesh, whole.blocks.unheard()
    if len(mesh.faces) < LEAST_FACES or not _may_pay(whole):
        return None
    # V₀; F₁ with V₁; F₂ with its vertices and edges.
    ends = _bent_ends(whole, blocks)
    _, inner = _faces_around(ends, mesh, blocks)
    part, corners = _faces_around(inner, mesh, blocks)
    faces = Rows.of(part)
    if len(faces.rows) > LARGEST_PART * len(part):
        return None
    vertices, edges = Rows.of(corners), Rows.of(_sides(part, mesh, blocks))
    if len(faces.rows) == 0:
        return BentPart(None, vertices, edges)
    own = _cut(mesh, faces, vertices, edges, blocks)
    return BentPart(_of_part(whole, own, vertices.rows), vertices, edges)


def _may_pay(whole: Surroundings) -> bool:
    """Return whether few enough edges bend, by a sample."""
    mesh, asked = whole.mesh, -(-len(whole.mesh.edges) // STRIDE)
    bent = count_bent(whole.faces.normals, mesh.half_edges, mesh.edge_class, STRIDE)
    return bent <= MOST_BENT * asked


def _bent_ends(whole: Surroundings, blocks: Blocks) -> Bool[np.ndarray, " V"]:
    mesh, ends = whole.mesh, np.zeros(whole.mesh.vertex_count, dtype=bool)
    args = whole.faces.normals, mesh.edges, mesh.half_edges, mesh.edge_class, ROWS, ends
    blocks.run(len(mesh.edges), mark_bent_ends.over(*args))
    return ends


def _faces_around(
    marked: Bool[np.ndarray, " V"], mesh: MeshEdges, blocks: Blocks
) -> tuple[Bool[np.ndarray, " F"], Bool[np.ndarray, " V"]]:
    """Return the faces that touch marked vertices, and all corners of these."""
    touched, corners = np.empty(len(mesh.faces), dtype=bool), np.zeros(len(marked), dtype=bool)
    blocks.run(len(touched), mark_around.over(mesh.faces, marked, ROWS, touched, corners))
    return touched, corners


def _sides(part: Bool[np.ndarray, " F"], mesh: MeshEdges, blocks: Blocks) -> Bool[np.ndarray, " E"]:
    """Return the edges of some faces."""
    sides = np.zeros(len(mesh.edges), dtype=bool)
    blocks.run(len(part), mark_sides.over(mesh.face_edges, part, ROWS, sides))
    return sides


def _cut(mesh: MeshEdges, faces: Rows, vertices: Rows, edges: Rows, blocks: Blocks) -> MeshEdges:
    """Return some faces, with their vertices and edges, as a mesh."""
    corners, sides = (np.empty((len(faces.rows), 3), dtype=np.int32) for _ in range(2))
    for values, numbers, taken in (
        (mesh.faces, vertices.numbers, corners),
        (mesh.face_edges, edges.numbers, sides),
    ):
        take = take_faces.over(values, numbers, faces.rows, ROWS, taken)
        blocks.run(len(faces.rows), take)
    count = len(edges.rows)
    ends, half_edges = (np.empty((count, 2), dtype=np.int32) for _ in range(2))
    edge_class = np.empty(count, dtype=np.int8)
    of_whole = mesh.edges, mesh.half_edges, mesh.edge_class, edges.rows
    numbers = vertices.numbers, faces.numbers, faces.flags
    blocks.run(count, take_edges.over(*of_whole, *numbers, ROWS, ends, half_edges, edge_class))
    own = corners, ends, sides, half_edges, edge_class
    return MeshEdges(len(vertices.rows), *own, plain=mesh.plain)


def _of_part(whole: Surroundings, mesh: MeshEdges, vertices: Int[np.ndarray, " n"]) -> Surroundings:
    """Return what the rules read of the part, whose vertices are these of the whole."""
    points = np.take(whole.points, vertices, axis=0)
    curves = whole.curves
    if len(curves.pushes):
        pushes, movable = np.take(curves.pushes, vertices, axis=0), curves.movable[vertices]
        curves = replace(curves, pushes=pushes, movable=movable)
    return replace(
        whole,
        points=points,
        mesh=mesh,
        faces=FaceMeasures(points, mesh.faces, whole.faces.blocks),
        multi_fan_vertices=whole.multi_fan_vertices[vertices],
        reference_length=_at(vertices, whole.reference_length),
        curves=curves,
        prior_strength=_at(vertices, whole.prior_strength),
    )


def _at(
    vertices: Int[np.ndarray, " n"], values: float | Float[np.ndarray, " V"]
) -> float | Float[np.ndarray, " n"]:
    """Return some of each vertex's own values, or that of the whole mesh."""
    return values[vertices] if isinstance(values, np.ndarray) else values


def _values(added: Additions) -> tuple[np.ndarray, ...]:
    of_step = added.displacement, added.ratio, added.gate, added.envelope
    return *of_step, added.degenerate
