"""Connectivity of a triangle mesh: edges, edge stencils, edge classes and the 1-to-4 split.

Everything here is int64 numpy and knows no positions. The orders are part of the result: edges are
numbered by first appearance over the faces' (a, b), (b, c), (c, a).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import marked
from pns_common.base.cached import cached_property
from pns_common.mesh import repeated_vertex

# The children of a face, by its corners a, b, c (0, 1, 2) and edge vertices ab, bc, ca (3, 4, 5).
CHILDREN = np.array([(0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)])


class EdgeClass(IntEnum):
    """What an edge is to the rules."""

    INTERIOR = 0  # exactly two incident faces, of opposite direction
    BOUNDARY = 1  # one incident face
    IRREGULAR = 2  # anything else
    CREASE = 3  # would be interior, and is kept sharp on request


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges of a face list. −1 stands where an edge has no such face or vertex.

    Attributes:
        vertex_count: number of vertices, isolated ones included.
        faces: (F, 3) vertices of each face.
        edges: (E, 2) endpoints a < b.
        face_edges: (F, 3) edges (a, b), (b, c), (c, a) of each face.
        half_edges: (E, 2) of an interior or crease edge its half-edges, lower face first; else −1.
            Half-edge h = 3 f + i runs from corner i of face f to the next corner.
        stencil: (E, 4) a, b, c, d; c is opposite in the face of lower index, d in the other; −1
            where there are no half-edges.
        edge_class: (E,) EdgeClass values.
        interior: (I,) indices of the interior edges.
    """

    vertex_count: int
    faces: Int[np.ndarray, "F 3"]
    edges: Int[np.ndarray, "E 2"]
    face_edges: Int[np.ndarray, "F 3"]
    half_edges: Int[np.ndarray, "E 2"]
    stencil: Int[np.ndarray, "E 4"]
    edge_class: Int[np.ndarray, " E"]
    interior: Int[np.ndarray, " I"]

    @property
    def edge_faces(self) -> Int[np.ndarray, "E 2"]:
        """The two faces of interior and crease edges, lower index first; −1 at other edges."""
        return self.half_edges // 3

    @cached_property
    def smooth_vertices(self) -> Bool[np.ndarray, " V"]:
        """Vertices with one closed ring of interior edges: those that a learned rule may move."""
        used = marked(self.edges.reshape(-1), self.vertex_count)
        return used & (sharp_edge_count(self) == 0) & ~self.multi_fan_vertices

    @cached_property
    def ringed_vertices(self) -> Bool[np.ndarray, " V"]:
        """The same with darts, where one crease ends: Loop's rule moves them as smooth ones."""
        creases = self.edges[self.edge_class == EdgeClass.CREASE]
        if len(creases) == 0:
            return self.smooth_vertices
        at_creases = marked(creases.reshape(-1), self.vertex_count)
        darts = at_creases & (sharp_edge_count(self) == 1) & ~self.multi_fan_vertices
        return self.smooth_vertices | darts

    @cached_property
    def multi_fan_vertices(self) -> Bool[np.ndarray, " V"]:
        """Vertices whose faces form more than one fan (bow-ties among them): asked thrice.

        A fan is a run of corners joined across interior edges: an open fan has one join fewer than
        corners, a closed one as many. Closed fans are told apart by pointer doubling.
        """
        corner_count = np.bincount(self.faces.reshape(-1), minlength=self.vertex_count)
        following = across_from_corners(self, np.flatnonzero(self.half_edges[:, 0] >= 0))
        corners = np.arange(len(following))
        label, hop = corners.copy(), following.copy()
        for _ in range(int(corner_count.max()).bit_length()):
            ahead = np.where(hop >= 0, hop, corners)
            label = np.minimum(label, label[ahead])
            hop = np.where(hop >= 0, hop[ahead], -1)
        leaders = ((hop >= 0) & (label == corners)) | (following < 0)
        fans = np.bincount(self.faces.reshape(-1)[leaders], minlength=self.vertex_count)
        return fans > 1

    @cached_property
    def valence(self) -> Int[np.ndarray, " V"]:
        """The number of edges at each vertex."""
        return np.bincount(self.edges.reshape(-1), minlength=self.vertex_count)


@runtime_checkable
class Connectivity(Protocol):
    """What a report reads of a topology."""

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        ...

    @property
    def faces(self) -> Int[np.ndarray, "F 3"]:
        """Vertices of each face."""
        ...

    @property
    def edge_class(self) -> Int[np.ndarray, " E"]:
        """EdgeClass values."""
        ...

    @property
    def interior(self) -> Int[np.ndarray, " I"]:
        """Indices of the interior edges."""
        ...


def build_topology(faces: Int[np.ndarray, "F 3"], vertex_count: int) -> Topology:
    """Pair the half-edges of ``faces`` into edges and classify them."""
    start = faces.reshape(-1)
    end = np.take(faces, [1, 2, 0], axis=1).reshape(-1)
    low, high = np.minimum(start, end), np.maximum(start, end)
    key, order = stable_sort(low * np.int64(vertex_count) + high)

    # Runs of equal keys are edges; within a run half-edges ascend, so the first is the earliest.
    opens = np.ones(len(key), dtype=bool)
    np.not_equal(key[1:], key[:-1], out=opens[1:])
    run_start = np.flatnonzero(opens)
    count = np.diff(run_start, append=len(key))
    first, second = order[run_start], order[np.minimum(run_start + 1, len(key) - 1)]

    # Number the edges by their first half-edge.
    is_first = marked(first, len(key))
    number = np.take(np.cumsum(is_first), first) - 1
    edge_of = np.empty(len(key), dtype=np.int64)
    edge_of[order] = np.repeat(number, count)
    earliest = np.flatnonzero(is_first)
    edges = np.stack([np.take(low, earliest), np.take(high, earliest)], axis=1)

    # An interior edge has two half-edges that run against each other, in faces of three vertices.
    proper = ~np.repeat(repeated_vertex(faces), 3)
    forward = start < end
    whole = np.take(proper, first)
    opposed = (count == 2) & (np.take(forward, first) != np.take(forward, second))
    opposed &= whole & np.take(proper, second)
    edge_class = np.full(len(edges), EdgeClass.IRREGULAR, dtype=np.int8)
    edge_class[number[(count == 1) & whole]] = EdgeClass.BOUNDARY
    edge_class[number[opposed]] = EdgeClass.INTERIOR

    half_edges = np.full((len(edges), 2), -1, dtype=np.int64)
    half_edges[number[opposed], 0] = first[opposed]
    half_edges[number[opposed], 1] = second[opposed]
    interior = np.flatnonzero(edge_class == EdgeClass.INTERIOR)
    stencil = np.full((len(edges), 4), -1, dtype=np.int64)
    stencil[:, :2] = edges
    # The vertex of a triangle that is on neither end: all three less those two.
    vertex_sum = faces[:, 0] + faces[:, 1] + faces[:, 2]
    ends = edges[interior, 0] + edges[interior, 1]
    for side in (0, 1):
        stencil[interior, 2 + side] = np.take(vertex_sum, half_edges[interior, side] // 3) - ends
    return Topology(
        vertex_count=vertex_count,
        faces=faces,
        edges=edges,
        face_edges=edge_of.reshape(-1, 3),
        half_edges=half_edges,
        stencil=stencil,
        edge_class=edge_class,
        interior=interior,
    )


def vertices_across(
    faces: Int[np.ndarray, "F 3"],
    edges: Int[np.ndarray, "N 2"],
    half_edges: Int[np.ndarray, "N 2"],
) -> Int[np.ndarray, "N 2"]:
    """Return the vertices that the two faces beside each of some edges have on neither end."""
    # All three of a triangle less those two.
    three = faces[half_edges // 3].sum(axis=2, dtype=np.int64)
    return three - edges.sum(axis=1, dtype=np.int64)[:, None]


def split(topology: Topology) -> Int[np.ndarray, "C 3"]:
    """Split 1-to-4: face f becomes (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca).

    These are faces 4f … 4f+3. The vertex of edge e is V + e; old vertices keep their numbers.
    """
    return split_faces(topology.faces, topology.face_edges, topology.vertex_count)


def split_faces(
    faces: Int[np.ndarray, "F 3"], face_edges: Int[np.ndarray, "F 3"], vertex_count: int
) -> Int[np.ndarray, "C 3"]:
    """Return the same of faces with their edges (a, b), (b, c), (c, a)."""
    six = np.concatenate([faces, face_edges + vertex_count], axis=1)  # a, b, c, ab, bc, ca
    return np.take(six, CHILDREN.reshape(-1), axis=1).reshape(-1, 3)


def children_across(topology: Topology, edges: Int[np.ndarray, " N"]) -> Int[np.ndarray, "2 N 2"]:
    """Pair the faces of the split mesh across interior edges: those at one end, at the other.

    Corner i of face f keeps child 4f + i, and one face's half-edge starts where the other's ends.
    """
    start = topology.half_edges[edges]
    end = next_corner(start)
    children = [corners + corners // 3 for corners in (start, end)]
    return np.stack([np.stack([children[i][:, 0], children[1 - i][:, 1]], axis=-1) for i in (0, 1)])


def sharp_edge_count(topology: Topology) -> Int[np.ndarray, " V"]:
    """Return for each vertex the number of edges at it that are not interior."""
    sharp = topology.edges[topology.edge_class != EdgeClass.INTERIOR]
    return np.bincount(sharp.reshape(-1), minlength=topology.vertex_count)


def stable_sort(
    key: Int[np.ndarray, " N"],
) -> tuple[Int[np.ndarray, " N"], Int[np.ndarray, " N"]]:
    """Return non-negative keys in order, and the positions they come from; equal keys keep theirs.

    Packing (key, position) into one integer and sorting values is several times faster than
    argsort; where the pack would overflow, argsort serves.
    """
    bits = len(key).bit_length()
    if len(key) and int(key.max()) < 2 ** (63 - bits):
        packed = key << bits
        packed |= np.arange(len(key))
        packed.sort()
        return packed >> bits, packed & (2**bits - 1)
    order = np.argsort(key, kind="stable")
    return key[order], order


def next_corner(corner: Int[np.ndarray, "..."]) -> Int[np.ndarray, "..."]:
    """Return the corner 3 f + (i + 1) mod 3 after corner 3 f + i of the same face."""
    place = corner - 3 * (corner // 3)  # numpy divides much faster than it takes remainders
    return corner + 1 - 3 * (place == 2)


def across_from_corners(topology: Topology, edges: Int[np.ndarray, " N"]) -> Int[np.ndarray, " C"]:
    """Return for each corner the next clockwise around its vertex, across one of some edges.

    They are interior or creases; −1 where the half-edge that leaves the corner is on none of them.
    """
    start = topology.half_edges[edges]
    clockwise = np.full(topology.faces.size, -1, dtype=np.int64)
    clockwise[start] = next_corner(start)[:, ::-1]
    return clockwise
