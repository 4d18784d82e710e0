"""The connectivity that a level's kernels read, in int32: built once, then split by arithmetic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.base.blocks import Blocks
from pns_common.base.cached import cached_property
from pns_common.connectivity.doubled_faces import is_plain
from pns_common.connectivity.topology import build_topology
from pns_common.fused.freed_memory import make_room
from pns_common.fused.kernels.children import (
    number_halves,
    split_edges,
    split_faces,
    split_faces_long,
)
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.edges import (
    HIGH,
    INTERIOR,
    NONE,
    SEVERAL,
    TOO_LONG,
    chain_edges,
    classify,
    count_ends,
)
from pns_common.fused.kernels.owned import PASSED_BY

# Steps along chains that an edge may take on average: more, and a sort is as fast.
STEPS = 32


@dataclass(frozen=True, eq=False)
class MeshEdges:
    """Edges of a face list, as ``topology.Topology`` has them, in int32.

    Attributes:
        half_edges: of every edge its first half-edge, and its second: −1 where there is none, −2
            where there are more than two.
        plain: no face repeats a vertex and no two faces have the same three.
    """

    vertex_count: int
    faces: Int[np.ndarray, "F 3"]
    edges: Int[np.ndarray, "E 2"]
    face_edges: Int[np.ndarray, "F 3"]
    half_edges: Int[np.ndarray, "E 2"]
    edge_class: Int[np.ndarray, " E"]
    plain: bool

    @property
    def starts(self) -> Int[np.ndarray, " H"]:
        """Where each half-edge starts."""
        return self.faces.reshape(-1)

    @property
    def interior(self) -> Int[np.ndarray, " I"]:
        """Indices of the interior edges."""
        return self._interior

    @cached_property
    def _interior(self) -> Int[np.ndarray, " I"]:
        if len(self.sharp_edges) == 0:
            return np.arange(len(self.edge_class), dtype=np.int32)
        return np.flatnonzero(self.edge_class == INTERIOR).astype(np.int32)

    @cached_property
    def edge_reach(self) -> Int[np.ndarray, "B 2"]:
        """The smallest and the largest vertex of each block of edges (kernels/owned.py)."""
        return _reach(self.edges.reshape(-1), 2 * PASSED_BY)

    @cached_property
    def face_reach(self) -> Int[np.ndarray, "B 2"]:
        """The same of the faces."""
        return _reach(self.faces.reshape(-1), 3 * PASSED_BY)

    @cached_property
    def sharp_edges(self) -> Int[np.ndarray, " S"]:
        """Indices of the edges that are not interior."""
        return np.flatnonzero(self.edge_class != INTERIOR).astype(np.int32)

    @cached_property
    def sharp(self) -> Int[np.ndarray, " N"]:
        """How many sharp edges each vertex has; none at all is (0,)."""
        if len(self.sharp_edges) == 0:
            return np.zeros(0, dtype=np.int32)
        counts = np.zeros(self.vertex_count, dtype=np.int32)
        count_ends(self.edges, self.sharp_edges, counts)
        return counts


def _reach(vertices: Int[np.ndarray, " N"], each: int) -> Int[np.ndarray, "B 2"]:
    """Return the smallest and the largest of each so many."""
    starts = np.arange(0, len(vertices), each)
    ends = np.minimum.reduceat(vertices, starts), np.maximum.reduceat(vertices, starts)
    return np.stack(ends, axis=1)


def in_int32(faces: Int[np.ndarray, "F 3"], blocks: Blocks) -> Int[np.ndarray, "F 3"]:
    """Return a copy of faces for the kernels, row by row."""
    narrow = np.empty(faces.shape, dtype=np.int32)

    def copy(rows: slice) -> None:
        narrow[rows] = faces[rows]

    blocks.unheard().run(len(faces), copy)
    return narrow


@dataclass(frozen=True, eq=False)
class Chains:
    """The edges of a face list as ``chain_edges`` writes them, of which there are ``count``."""

    count: int
    low: Int[np.ndarray, " H"]
    links: Int[np.ndarray, "H 4"]
    face_edges: Int[np.ndarray, "F 3"]
    plain: bool

    @property
    def edges(self) -> Int[np.ndarray, "E 2"]:
        """Endpoints a < b."""
        return np.stack([self.low[: self.count], self.links[: self.count, HIGH]], axis=1)


def chains_of(faces: Int[np.ndarray, "F 3"], vertex_count: int) -> Chains | None:
    """Chain the edges of int32 faces; None where a sort is as fast."""
    count = len(faces)
    # As many as there could be: what is not written is not in memory.
    head = np.full(vertex_count, -1, dtype=np.int32)
    low, links = np.empty(3 * count, dtype=np.int32), np.empty((3 * count, 4), dtype=np.int32)
    face_edges, plain = np.empty((count, 3), dtype=np.int32), np.empty(1, dtype=np.int32)
    edge_count = chain_edges(faces, 3 * STEPS * count, head, low, links, face_edges, plain)
    if edge_count == TOO_LONG:
        return None
    return Chains(edge_count, low, links, face_edges, plain=bool(plain[0]))


def build_edges(faces: Int[np.ndarray, "F 3"], vertex_count: int, blocks: Blocks) -> MeshEdges:
    """Build the edges of int32 faces."""
    chains = chains_of(faces, vertex_count)
    if chains is None:
        return _sorted_edges(faces, vertex_count)
    edges, half_edges = (np.empty((chains.count, 2), dtype=np.int32) for _ in range(2))
    edge_class = np.empty(chains.count, dtype=np.int8)
    chained = faces, faces.reshape(-1), chains.low, chains.links, int(chains.plain)
    blocks.run(chains.count, classify.over(*chained, ROWS, edges, half_edges, edge_class))
    return MeshEdges(
        vertex_count, faces, edges, chains.face_edges, half_edges, edge_class, plain=chains.plain
    )


def split_mesh_edges(parent: MeshEdges, blocks: Blocks) -> MeshEdges:
    """Return the split mesh's edges; creases stay creases only where the parent is plain."""
    count, vertices = len(parent.faces), parent.vertex_count + len(parent.edges)
    faces = split_mesh_faces(parent, np.int32, blocks)
    if not parent.plain:
        return build_edges(faces, vertices, blocks)
    halves = np.empty((len(parent.edges), 2), dtype=np.int32)
    of_parent = parent.faces, parent.face_edges, parent.edges, parent.half_edges
    blocks.run(count, number_halves.over(*of_parent, ROWS, halves))
    made = 2 * len(parent.edges) + 3 * count
    edges, half_edges = (np.empty((made, 2), dtype=np.int32) for _ in range(2))
    edge_class, face_edges = np.empty(made, dtype=np.int8), np.empty((4 * count, 3), dtype=np.int32)
    of_parent = parent.faces, parent.face_edges, parent.half_edges, parent.edge_class
    to = face_edges, edges, half_edges, edge_class
    blocks.run(count, split_edges.over(*of_parent, halves, parent.vertex_count, ROWS, *to))
    return MeshEdges(vertices, faces, edges, face_edges, half_edges, edge_class, plain=True)


def split_mesh_faces(
    parent: MeshEdges, dtype: type[np.int32] | type[np.int64], blocks: Blocks
) -> Int[np.ndarray, "C 3"]:
    """Return the children of the faces, as ``topology.split`` orders them."""
    faces = np.empty((4 * len(parent.faces), 3), dtype=dtype)
    make_room(faces.nbytes)
    split = split_faces if dtype is np.int32 else split_faces_long
    of_parent = parent.faces, parent.face_edges, parent.vertex_count
    blocks.run(len(parent.faces), split.over(*of_parent, ROWS, faces))
    return faces


def _sorted_edges(faces: Int[np.ndarray, "F 3"], vertex_count: int) -> MeshEdges:
    """Build the same by sorting, for meshes whose hubs make chains long."""
    topology = build_topology(faces.astype(np.int64), vertex_count)
    edge_of = topology.face_edges.reshape(-1)
    half_edges = topology.half_edges.astype(np.int32)
    lone = np.bincount(edge_of) == 1
    half_edges[:, 1] = np.where(
        lone, NONE, np.where(half_edges[:, 1] < 0, SEVERAL, half_edges[:, 1])
    )
    half_edges[:, 0] = np.unique(edge_of, return_index=True)[1]
    return MeshEdges(
        vertex_count,
        faces,
        topology.edges.astype(np.int32),
        topology.face_edges.astype(np.int32),
        half_edges,
        topology.edge_class,
        plain=is_plain(topology),
    )
