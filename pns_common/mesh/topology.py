"""Connectivity of a mesh: edges, edge classes and sharpness, fans; splits of its faces.

Nothing here knows positions. The orders are part of the result: edges are numbered by first
appearance over the faces, (a, b), (b, c), … from each face's first corner on.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Integer, UInt32

from pns_common.errors import MeshError, ParameterError
from pns_common.kernels import Connectivity, loop, split
from pns_common.kernels import connectivity as kernels
from pns_common.mesh.rows import marked
from pns_common.mesh.sectors import find_sectors
from pns_common.parallel import LEAST_ROWS, Blocks

# Steps along chains that an edge may take on average; beyond that, sorting is as fast.
STEPS = 32
TRIANGLE, QUAD = 3, split.QUAD
NO_WEIGHTS = np.zeros(0)
# Edges of a sharpness above this count as sharp where there is only yes and no.
MOSTLY_SHARP = 1 / 2
NO_FACES = np.zeros(0, dtype=np.uint32)


def some_weights(weights: Float[np.ndarray, " N"]) -> Float[np.ndarray, " W"]:
    """Return weights; (0,) where all are 0."""
    return weights if weights.any() else NO_WEIGHTS


class EdgeClass(IntEnum):
    """The rules' view of an edge."""

    INTERIOR = kernels.INTERIOR  # exactly two incident faces, of opposite direction
    BOUNDARY = kernels.BOUNDARY  # one incident face
    IRREGULAR = kernels.IRREGULAR  # anything else
    CREASE = kernels.CREASE  # between two faces like an interior edge, with sharpness 1


@dataclass(frozen=True, eq=False)
class SharpVertices:
    """The vertices at which the rules of curves and corners act.

    Attributes:
        rows: vertices on two or more edges of sharpness above 0.
        weights: (V, 3) the three largest sharpnesses w at each vertex, descending, each as
            κ + (1 − κ) w: a vertex of corner weight κ is so far like one on three sharp edges.
        neighbours: (V, 2) the far ends of the two sharpest edges.
    """

    rows: Integer[np.ndarray, " N"]
    weights: Float[np.ndarray, "V 3"]
    neighbours: Integer[np.ndarray, "V 2"]


@dataclass(frozen=True, eq=False)
class Topology:
    """Faces of any degree with their edges.

    Half-edge h runs from corner h to the next corner of the same face.

    Attributes:
        vertex_count: number of vertices, isolated ones included.
        corners: (H,) vertices of the faces, face after face.
        offsets: (F + 1,) where the corners of each face begin.
        face_of_corner: (H,); (0,) where all faces are triangles.
        edges: (E, 2) endpoints a < b.
        corner_edges: (H,) the edge that leaves each corner.
        half_edges: (E, 2) an edge's first half-edge and its second: −1 where there is none, −2
            where there are more than two.
        edge_class: (E,) EdgeClass values.
        soft: (E,) sharpness w in [0, 1] of interior edges; (0,) where it is 0 at all of them. Other
            edges have w = 1.
        vertex_sharpness: (V,) at how many more levels each vertex is a corner, infinity for good,
            its last part in part; (0,) where none is.
        plain: no face names a vertex twice, and no two triangles have the same vertices.
        wear: (E,) at how many more levels each edge that wears off is sharp, infinity for good, its
            last part in part; (0,) where none does.
        found: (E,) learned sharpness of edges that wear off: they are at least so sharp; (0,) where
            it is 0 at all.
        soft_corners: (V,) learned corner weight κ in [0, 1] of each vertex, which lasts as long as
            the sharpness of edges; (0,) where it is 0 at all.
    """

    vertex_count: int
    corners: UInt32[np.ndarray, " H"]
    offsets: Integer[np.ndarray, " F1"]
    face_of_corner: UInt32[np.ndarray, " C"]
    edges: UInt32[np.ndarray, "E 2"]
    corner_edges: UInt32[np.ndarray, " H"]
    half_edges: Integer[np.ndarray, "E 2"]
    edge_class: Integer[np.ndarray, " E"]
    soft: Float[np.ndarray, " S"]
    vertex_sharpness: Float[np.ndarray, " K"]
    plain: bool
    soft_corners: Float[np.ndarray, " SV"] = field(default_factory=lambda: NO_WEIGHTS)
    wear: Float[np.ndarray, " W"] = field(default_factory=lambda: NO_WEIGHTS)
    found: Float[np.ndarray, " SW"] = field(default_factory=lambda: NO_WEIGHTS)

    @cached_property
    def connectivity(self) -> Connectivity:
        """The arrays that loops read."""
        return Connectivity(*(getattr(self, name) for name in Connectivity._fields))

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return len(self.offsets) - 1

    @property
    def triangles(self) -> bool:
        """True where all faces are triangles."""
        return len(self.face_of_corner) == 0

    @property
    def faces(self) -> UInt32[np.ndarray, "F 3"]:
        """Vertices of each triangle. Raises ValueError unless all faces are triangles."""
        self._need_triangles()
        return self.corners.reshape(-1, TRIANGLE)

    @property
    def face_edges(self) -> UInt32[np.ndarray, "F 3"]:
        """Edges (a, b), (b, c), (c, a) of each triangle; ValueError as for ``faces``."""
        self._need_triangles()
        return self.corner_edges.reshape(-1, TRIANGLE)

    def face_of(self, corners: Integer[np.ndarray, "*N"]) -> Integer[np.ndarray, "*N"]:
        """Return the faces of some corners."""
        return corners // TRIANGLE if self.triangles else self.face_of_corner[corners]

    def _need_triangles(self) -> None:
        if not self.triangles:
            raise ValueError("this mesh has faces that are no triangles")

    @cached_property
    def interior(self) -> UInt32[np.ndarray, " I"]:
        """Indices of the interior edges."""
        return np.flatnonzero(self.edge_class == kernels.INTERIOR).astype(np.uint32)

    @cached_property
    def sharp_edges(self) -> UInt32[np.ndarray, " S"]:
        """Indices of the edges that are not interior."""
        return np.flatnonzero(self.edge_class != kernels.INTERIOR).astype(np.uint32)

    @cached_property
    def crease_edges(self) -> Integer[np.ndarray, " S"]:
        """Indices of the creases."""
        sharp = self.sharp_edges
        return sharp[self.edge_class[sharp] == kernels.CREASE].astype(np.int64)

    @cached_property
    def sharp_count(self) -> Integer[np.ndarray, " V"]:
        """Number of edges at each vertex that are not interior; (0,) where there is none."""
        if len(self.sharp_edges) == 0:
            return np.zeros(0, dtype=np.int32)
        return self.count_ends(self.sharp_edges)

    def count_ends(self, rows: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, " V"]:
        """Return how many of some edges end at each vertex."""
        ends = self.edges[rows].reshape(-1)
        return np.bincount(ends, minlength=self.vertex_count).astype(np.int32)

    @cached_property
    def sharpness(self) -> Float[np.ndarray, " E"]:
        """Sharpness w of every edge."""
        if len(self.soft):
            return np.where(self.edge_class == kernels.INTERIOR, self.soft, 1.0)
        return (self.edge_class != kernels.INTERIOR).astype(np.float64)

    @property
    def is_sharp(self) -> Bool[np.ndarray, " E"]:
        """Flags of creases, and of interior edges of sharpness above ½."""
        creases = self.edge_class == kernels.CREASE
        return creases | (self.soft > MOSTLY_SHARP) if len(self.soft) else creases

    @property
    def corner_weights(self) -> Float[np.ndarray, " V"]:
        """Corner weight κ of every vertex."""
        weights = np.zeros(self.vertex_count)
        if len(self.vertex_sharpness):
            weights = np.minimum(self.vertex_sharpness, 1.0)
        return np.maximum(weights, self.soft_corners) if len(self.soft_corners) else weights

    @property
    def has_corners(self) -> bool:
        """True where any vertex has a corner weight."""
        return len(self.vertex_sharpness) > 0 or len(self.soft_corners) > 0

    @cached_property
    def sharpest(self) -> SharpVertices | None:
        """The vertices on sharp and soft edges, and corners; None where there is none of all.

        Where sharpness is learned, corners too, soft edges do not count at the ends of boundaries,
        so that meshes that share a boundary still meet there. Edges that wear off at this level
        count in part, as in OpenSubdiv: by the mean of what is left of them at each vertex.
        """
        if not (self.edge_class.any() or len(self.soft) or self.has_corners):
            return None
        weights, neighbours = self._three_sharpest(self.edge_class, self.soft)
        ending = (self.wear > 0) & (self.wear <= 1)
        if ending.any():
            ends, left = self.edges[ending].reshape(-1), np.repeat(self.wear[ending], 2)
            count = np.bincount(ends, minlength=self.vertex_count)
            total = np.bincount(ends, left, self.vertex_count)
            share = (total / np.maximum(count, 1))[:, None]
            soft, found = (
                rows if len(rows) else np.zeros(len(ending)) for rows in (self.soft, self.found)
            )
            soft, classes = np.where(ending, found, soft), self.edge_class.copy()
            classes[ending] = kernels.INTERIOR
            weights, neighbours = self._three_sharpest(classes, soft)
            classes[ending] = kernels.CREASE
            sharper, beside = self._three_sharpest(classes, soft)
            # Where a curve is left without them, it goes on.
            curve = weights[:, 1:2] > weights[:, 2:]
            neighbours = np.where(curve, neighbours, beside)
            weights = weights + share * (sharper - weights)
        if self.has_corners:
            corner = self.corner_weights
            rows = np.flatnonzero(corner)
            corner = corner[rows, None]
            weights[rows] = corner + (1 - corner) * weights[rows]
        return SharpVertices(np.flatnonzero(weights[:, 1] > 0), weights, neighbours)

    def _three_sharpest(
        self, classes: Integer[np.ndarray, " E"], soft: Float[np.ndarray, " S"]
    ) -> tuple[Float[np.ndarray, "V 3"], UInt32[np.ndarray, "V 2"]]:
        """Return ``SharpVertices``'s weights and neighbours of edges of these classes and w."""
        weights, neighbours = self._sharpest_of(classes, soft)
        if len(soft) and len(self.soft_corners):
            on_boundary = classes == kernels.BOUNDARY
            if on_boundary.any():
                ends = np.unique(self.edges[on_boundary])
                given = np.where(self.wear > 0, soft, 0.0) if len(self.wear) else NO_WEIGHTS
                at_ends, beside = self._sharpest_of(classes, given)
                weights[ends], neighbours[ends] = at_ends[ends], beside[ends]
        return weights, neighbours

    def _sharpest_of(
        self, classes: Integer[np.ndarray, " E"], soft: Float[np.ndarray, " S"]
    ) -> tuple[Float[np.ndarray, "V 3"], UInt32[np.ndarray, "V 2"]]:
        weights = np.zeros((self.vertex_count, 3))
        neighbours = np.zeros((self.vertex_count, 2), dtype=np.uint32)
        loop.sharpest_edges(self.edges, classes, soft, weights, neighbours)
        return weights, neighbours

    @cached_property
    def valence(self) -> Integer[np.ndarray, " V"]:
        """Number of edges at each vertex."""
        return np.bincount(self.edges.reshape(-1), minlength=self.vertex_count).astype(np.int32)

    @cached_property
    def edge_reach(self) -> Integer[np.ndarray, "B 2"]:
        """Smallest and largest vertex of each block of edges."""
        return _reach(self.edges.reshape(-1), 2 * kernels.SKIPPED_ROWS, self.vertex_count)

    @cached_property
    def corner_reach(self) -> Integer[np.ndarray, "B 2"]:
        """Smallest and largest vertex of each block of corners."""
        return _reach(self.corners, TRIANGLE * kernels.SKIPPED_ROWS, self.vertex_count)

    @cached_property
    def fan_count(self) -> Integer[np.ndarray, " V"]:
        """Number of fans that the faces of each vertex form; creases divide none."""
        around = find_sectors(self.without_creases().connectivity)
        return np.bincount(around.vertex, minlength=self.vertex_count)

    @property
    def multi_fan_vertices(self) -> Bool[np.ndarray, " V"]:
        """True for vertices whose faces form more than one fan, as at the knot of a bow-tie."""
        return self.fan_count > 1

    def with_creases(self, rows: Integer[np.ndarray, " N"]) -> Topology:
        """Return a copy in which the interior edges among ``rows`` are creases."""
        if len(rows) == 0:
            return self
        classes = self.edge_class.copy()
        classes[rows] = np.where(classes[rows] == kernels.INTERIOR, kernels.CREASE, classes[rows])
        return replace(self, edge_class=classes)

    def with_sharpness(self, sharpness: Float[np.ndarray, " E"]) -> Topology:
        """Return a copy with sharpness w of interior edges, where they have less.

        Those of w = 1 are creases.
        """
        sharper = self.with_creases(np.flatnonzero(sharpness >= 1))
        soft = np.maximum(sharpness, self.soft) if len(self.soft) else sharpness
        soft = np.where(sharper.edge_class == kernels.INTERIOR, soft, 0.0)
        found = self.found
        if len(self.wear):
            found = np.where((self.wear > 0) & np.isfinite(self.wear), sharpness, 0.0)
        return replace(sharper, soft=some_weights(soft), found=some_weights(found))

    def with_wear(self, sharpness: Float[np.ndarray, " E"]) -> Topology:
        """Return a copy whose interior edges are sharp for so many levels, infinity for good."""
        lasting = replace(self, wear=NO_WEIGHTS, found=NO_WEIGHTS)
        sharper = lasting.with_sharpness(np.minimum(sharpness, 1.0))
        wear = np.where(self.edge_class == kernels.INTERIOR, sharpness, 0.0)
        return replace(sharper, wear=some_weights(wear))

    def worn(
        self,
        parent: Topology,
        halves: Integer[np.ndarray, "E 2"] | None = None,
        *,
        inherit: bool = True,
    ) -> Topology:
        """Return the copy of a split in which edges that wear off are a level less sharp.

        ``halves`` are the edges that each edge of the parent was split into, if they are known.
        ``inherit``: whether what is learned of them lasts.
        """
        if len(parent.wear) == 0:
            return self
        rows = np.flatnonzero(parent.wear)
        if halves is None:
            worn = self.rows_of(halves_of(parent, rows)).reshape(-1, 2)
        else:
            worn = halves[rows].astype(np.int64)
        classes, soft = self.edge_class.copy(), self.soft.copy()
        classes[worn] = kernels.INTERIOR
        if len(soft):
            soft[worn] = 0.0
        left, found = np.zeros((2, len(self.edges)))
        left[worn] = np.maximum(parent.wear[rows] - 1, 0.0)[:, None]
        split_mesh = replace(self, edge_class=classes, soft=soft).with_wear(left)
        if inherit and len(parent.found):
            found[worn] = parent.found[rows][:, None]
            split_mesh = split_mesh.with_sharpness(found)
        return split_mesh

    def with_border(self, rule: str) -> Topology:
        """Return a copy whose boundaries keep a rule of ``creases.BORDERS``."""
        if rule == "smooth":
            return self
        sharpness = np.zeros(self.vertex_count)
        sharpness[self.edges[self.edge_class == kernels.BOUNDARY]] = np.inf
        if rule == "corners":
            sharpness[np.bincount(self.corners, minlength=self.vertex_count) != 1] = 0.0
        return self.with_vertex_sharpness(sharpness)

    def with_vertex_sharpness(self, sharpness: Float[np.ndarray, " V"]) -> Topology:
        """Return a copy whose vertices are so sharp, where they are less."""
        if len(self.vertex_sharpness):
            sharpness = np.maximum(sharpness, self.vertex_sharpness)
        return replace(self, vertex_sharpness=some_weights(sharpness))

    def with_soft_corners(self, weights: Float[np.ndarray, " V"]) -> Topology:
        """Return a copy with learned corner weights, where they are less."""
        if len(self.soft_corners):
            weights = np.maximum(weights, self.soft_corners)
        return replace(self, soft_corners=weights)

    def soft_corners_of_split(self, count: int, *, inherit: bool) -> Float[np.ndarray, " SV"]:
        """Return ``soft_corners`` a level later, where there are ``count`` vertices.

        Those of weight 1, as where a boundary turns, stay for good.
        """
        weights = self.soft_corners if inherit else np.where(self.soft_corners < 1, 0, 1.0)
        if not (weights.any() or (inherit and len(weights))):
            return NO_WEIGHTS
        return np.concatenate([weights, np.zeros(count - self.vertex_count)])

    def worn_vertices(self, count: int) -> Float[np.ndarray, " K"]:
        """Return ``vertex_sharpness`` a level later, where there are ``count`` vertices."""
        if not (self.vertex_sharpness > 1).any():
            return NO_WEIGHTS
        worn = np.zeros(count)
        worn[: self.vertex_count] = np.maximum(self.vertex_sharpness - 1, 0.0)
        return worn

    def without_creases(self) -> Topology:
        """Return a copy without creases, soft edges and corners."""
        classes = np.where(self.edge_class == kernels.CREASE, kernels.INTERIOR, self.edge_class)
        kinds = "soft", "vertex_sharpness", "soft_corners", "wear", "found"
        none = dict.fromkeys(kinds, NO_WEIGHTS)
        return replace(self, edge_class=classes.astype(np.int8), **none)

    def without_soft(self) -> Topology:
        """Return a copy without soft edges and learned corners: what a user or a file marks."""
        return replace(self, soft=NO_WEIGHTS, soft_corners=NO_WEIGHTS)

    def rows_of(self, pairs: Integer[np.ndarray, "N 2"]) -> Integer[np.ndarray, " N"]:
        """Return the edges that pairs of vertices name.

        Raises:
            ParameterError: a pair is no edge.
        """
        check_vertices("creases", pairs, self.vertex_count)
        named = marked(pairs, self.vertex_count)
        near = np.flatnonzero(named[self.edges[:, 0]] & named[self.edges[:, 1]])
        keys, asked = (_keys(ends, self.vertex_count) for ends in (self.edges[near], pairs))
        order = np.argsort(keys, kind="stable")
        place = np.searchsorted(keys, asked, sorter=order)
        found = np.append(keys[order], -1)[place] == asked
        lost = np.flatnonzero(~found)
        if len(lost):
            row = int(lost[0])
            pair = pairs[row].tolist()
            raise ParameterError(f"creases[{row}]", pair, expected="an edge of the mesh")
        return near[order[place]]


def build_topology(
    faces: Integer[np.ndarray, "F 3"]
    | tuple[Integer[np.ndarray, " H"], Integer[np.ndarray, " F1"]],
    vertex_count: int,
    blocks: Blocks | None = None,
) -> Topology:
    """Find the edges of faces and classify them.

    Args:
        faces: (F, 3) triangles; or (corners, offsets) of faces of any degree ≥ 3.
        vertex_count: number of vertices.
        blocks: how the work is shared.

    Raises:
        MeshError: a face names a vertex that is not there.
    """
    blocks = blocks or Blocks()
    if isinstance(faces, tuple):
        corners, offsets = faces[0].astype(np.uint32), faces[1].astype(np.int32)
        degrees = np.diff(offsets)
    else:
        corners = np.ascontiguousarray(faces, dtype=np.uint32).reshape(-1)
        offsets = np.arange(0, len(corners) + 1, TRIANGLE, dtype=np.int32)
        degrees = NO_FACES
    if len(corners) and int(corners.max()) >= vertex_count:  # a kernel would write beyond an array
        raise MeshError(f"vertex {corners.max()}, expected 0 … {vertex_count - 1}", element="faces")
    triangles = bool((degrees == TRIANGLE).all())
    face_of_corner = NO_FACES
    if not triangles:
        face_of_corner = np.repeat(np.arange(len(degrees), dtype=np.uint32), degrees)
    edges, half_edges, corner_edges, plain = _number_edges(corners, offsets, vertex_count)
    repeats, repeating = np.zeros(0, dtype=bool), False
    if not (plain and triangles):
        repeats = np.empty(len(offsets) - 1, dtype=bool)
        last_face = np.full(vertex_count, -1, dtype=np.int32)
        repeating = kernels.mark_repeats(corners, offsets, last_face, repeats)
    edge_class = np.empty(len(edges), dtype=np.int8)
    known = corners, face_of_corner, repeats if repeating else repeats[:0], half_edges
    blocks.run(len(edges), kernels.classify_edges, *known, edge_class)
    return Topology(
        vertex_count,
        corners,
        offsets,
        face_of_corner,
        edges,
        corner_edges,
        half_edges,
        edge_class,
        NO_WEIGHTS,
        NO_WEIGHTS,
        (plain or not triangles) and not repeating,
    )


def split_triangles(parent: Topology, blocks: Blocks, *, inherit: bool = True) -> Topology:
    """Return the topology of the 1-to-4 split.

    Face f becomes faces 4 f … 4 f + 3 = (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca). The
    vertex of edge e is V + e; old vertices keep their numbers.

    Args:
        parent: a mesh of triangles.
        blocks: how the work is shared.
        inherit: whether the halves of creases and soft edges inherit their sharpness.
    """
    return split_into(split_faces(parent, blocks), parent, blocks, inherit=inherit)


def split_into(
    faces: UInt32[np.ndarray, "C N"], parent: Topology, blocks: Blocks, *, inherit: bool
) -> Topology:
    """Return the topology of a split into faces: triangles in four, or each corner into a quad."""
    quads, edge_count, count = faces.shape[1] != TRIANGLE, len(parent.edges), len(parent.corners)
    vertex_count = parent.vertex_count + edge_count + (parent.face_count if quads else 0)
    offsets = np.arange(0, faces.size + 1, faces.shape[1], dtype=np.int32)
    soft_corners = parent.soft_corners_of_split(vertex_count, inherit=inherit)
    vertices = {
        "vertex_sharpness": parent.worn_vertices(vertex_count),
        "soft_corners": soft_corners,
    }
    if not parent.plain:
        split_mesh = build_topology((faces.reshape(-1), offsets), vertex_count, blocks)
        split_mesh = replace(split_mesh, **vertices)
        if inherit:
            soft, creases = np.flatnonzero(parent.soft), parent.crease_edges
            halves = split_mesh.rows_of(halves_of(parent, np.concatenate([soft, creases])))
            sharpness = np.zeros(len(split_mesh.edges))
            sharpness[halves] = np.append(parent.soft[soft], np.ones(len(creases))).repeat(2)
            split_mesh = split_mesh.with_sharpness(sharpness)
        return split_mesh.worn(parent, inherit=inherit)
    read = (parent if inherit else parent.without_creases()).connectivity
    halves, corner_edges = np.empty((edge_count, 2), np.uint32), np.empty(faces.shape, np.uint32)
    blocks.run(parent.face_count, split.number_halves, read, quads, halves)
    # Each edge has two halves, and each corner an edge inside of its face.
    count += 2 * edge_count
    edges, half_edges = np.empty((count, 2), np.uint32), np.empty((count, 2), np.int32)
    edge_class, soft = np.empty(count, np.int8), NO_WEIGHTS
    to = corner_edges, edges, half_edges, edge_class
    blocks.run(parent.face_count, split.split_edges, read, quads, halves, *to)
    if inherit and len(parent.soft):
        rows, soft = np.flatnonzero(parent.soft), np.zeros(count)
        soft[halves[rows]] = parent.soft[rows, None]
    split_mesh = Topology(
        vertex_count,
        faces.reshape(-1),
        offsets,
        np.repeat(np.arange(len(faces), dtype=np.uint32), QUAD) if quads else NO_FACES,
        edges,
        corner_edges.reshape(-1),
        half_edges,
        edge_class,
        soft,
        plain=True,
        **vertices,
    )
    return split_mesh.worn(parent, halves, inherit=inherit)


def split_faces(
    parent: Topology, blocks: Blocks, dtype: type[np.uint32] | type[np.int64] = np.uint32
) -> Integer[np.ndarray, "C 3"]:
    """Return the triangles of the 1-to-4 split, in the order of ``split_triangles``."""
    faces = np.empty((4 * len(parent.faces), TRIANGLE), dtype=dtype)
    blocks.run(parent.face_count, split.split_triangles, parent.connectivity, faces)
    return faces


def split_quads(parent: Topology, blocks: Blocks, *, inherit: bool = True) -> Topology:
    """Return the topology of the split of faces of any degree into a quad for each corner.

    The vertex of edge e is V + e, that of face f is V + E + f. The quad of corner h is (its vertex,
    the vertex of the edge that leaves it, the face's vertex, that of the edge that enters it), and
    it is face h of the refined mesh. Arguments are as of ``split_triangles``.
    """
    return split_into(quad_faces(parent, blocks), parent, blocks, inherit=inherit)


def quad_faces(
    parent: Topology, blocks: Blocks, dtype: type[np.uint32] | type[np.int64] = np.uint32
) -> Integer[np.ndarray, "H 4"]:
    """Return the quads of the split, in the order of ``split_quads``."""
    faces = np.empty((len(parent.corners), QUAD), dtype=dtype)
    blocks.run(parent.face_count, split.split_into_quads, parent.connectivity, faces)
    return faces


def halves_of(parent: Topology, rows: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, "M 2"]:
    """Return the halves of edges, as vertex pairs of the split mesh."""
    ends, middle = parent.edges[rows].astype(np.int64), parent.vertex_count + rows.astype(np.int64)
    return np.stack([ends, np.stack([middle, middle], axis=1)], axis=-1).reshape(-1, 2)


def following(offsets: Integer[np.ndarray, " F1"]) -> Integer[np.ndarray, " H"]:
    """Return the next corner of the same face, of each corner; ``offsets`` as of a topology."""
    made = np.arange(1, offsets[-1] + 1, dtype=np.int64)
    made[offsets[1:] - 1] = offsets[:-1]
    return made


def check_vertices(name: str, given: Integer[np.ndarray, " N *K"], count: int) -> None:
    """Raise ParameterError where an argument names a vertex that is not there."""
    outside = np.argwhere((given < 0) | (given >= count))
    if len(outside):
        row, expected = int(outside[0, 0]), f"vertices 0 … {count - 1}"
        raise ParameterError(f"{name}[{row}]", given[row].tolist(), expected=expected)


Numbered = tuple[
    UInt32[np.ndarray, "E 2"], Integer[np.ndarray, "E 2"], UInt32[np.ndarray, " H"], bool
]


def _number_edges(
    corners: UInt32[np.ndarray, " H"], offsets: Integer[np.ndarray, " F1"], vertex_count: int
) -> Numbered:
    """Return edges, their half-edges, the edge of each corner, and whether triangles are plain."""
    count = len(corners)
    head, low = np.full(vertex_count, -1, dtype=np.int32), np.empty(count, dtype=np.uint32)
    links, corner_edges = np.empty((count, 4), np.int32), np.empty(count, np.uint32)
    plain = np.ones(1, dtype=np.int8)
    made = kernels.number_edges(
        corners, offsets, STEPS * count, head, low, links, corner_edges, plain
    )
    if made == kernels.TOO_LONG:
        return _sort_edges(corners, offsets, vertex_count)
    edges, links = np.empty((made, 2), np.uint32), links[:made]
    edges[:, 0], edges[:, 1] = low[:made], links[:, kernels.HIGH]
    half_edges = np.ascontiguousarray(links[:, kernels.FIRST :])
    return edges, half_edges, corner_edges, bool(plain[0])


def _sort_edges(
    corners: UInt32[np.ndarray, " H"], offsets: Integer[np.ndarray, " F1"], vertex_count: int
) -> Numbered:
    """Return what ``_number_edges`` does, by sorting: for vertices of thousands of edges."""
    pairs = np.stack([corners, corners[following(offsets)]], axis=1)
    keys = _keys(pairs, vertex_count)
    _, first, group, count = np.unique(
        keys, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.argsort(first)
    number = np.empty(len(order), dtype=np.uint32)
    number[order] = np.arange(len(order))
    in_runs = np.argsort(group, kind="stable")
    starts = np.cumsum(count) - count
    second = in_runs[np.minimum(starts + 1, len(keys) - 1)]
    second = np.where(count == 1, kernels.NONE, np.where(count == 2, second, kernels.SEVERAL))
    half_edges = np.stack([first, second], axis=1)[order].astype(np.int32)
    # Two triangles with two edges in common have all three.
    corner_edges = number[group]
    sides = np.sort(corner_edges[: 3 * (len(corners) // 3)].reshape(-1, 3), axis=1)
    plain = len(np.unique(_keys(sides[:, :2], len(order)))) == len(sides)
    plain = plain and bool((pairs[:, 0] != pairs[:, 1]).all())
    return np.sort(pairs[first[order]], axis=1), half_edges, corner_edges, plain


def _keys(pairs: Integer[np.ndarray, "N 2"], vertex_count: int) -> Integer[np.ndarray, " N"]:
    """Return one number for each pair of vertices, in whichever order."""
    wide = pairs.astype(np.int64)
    return wide.min(axis=1) * vertex_count + wide.max(axis=1)


def _reach(vertices: UInt32[np.ndarray, " N"], each: int, count: int) -> Integer[np.ndarray, "B 2"]:
    starts = np.arange(0, len(vertices), each)
    made = np.zeros((len(starts), 2), dtype=np.int64)
    if count < 2 * LEAST_ROWS:  # one thread reads all
        made[:, 1] = count
        return made
    made[:, 0] = np.minimum.reduceat(vertices, starts)
    made[:, 1] = np.maximum.reduceat(vertices, starts)
    return made
