"""Kept faces and what they were split into: how values at their corners reach the refined ones.

Corners of faces share rows of values, and new rows lie on the edges and inside of the faces over
these rows, so seams stay seams. Faces of whole levels are refined as `pns_common.carry` does;
faces of several levels are blends of their control face's corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.adaptive.corners import join_corners
from pns_common.carry import rules
from pns_common.carry.carried import Carrier, Column
from pns_common.carry.charts import chart_points, refine_charts
from pns_common.carry.columns import level_topologies
from pns_common.carry.descendants import copied_corners, corner_weights, cut_quads
from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.rows import ranges
from pns_common.mesh.topology import NO_WEIGHTS, Topology, following
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes import BaseScheme

from .polygons import KeptFaces


class Values(Protocol):
    """A map from values of rows to those of refined rows."""

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Return linear blends."""
        ...

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Return values of nearest corners."""
        ...


@dataclass(frozen=True, eq=False)
class Rows:
    """The N refined rows that C rows of corners become.

    Attributes:
        corners: (H,) the row at each corner of the kept faces.
        at: (X,) the refined row at each corner of the split.
        place: (N,) a corner of the split at each refined row.
        values: refines values of rows.
    """

    corners: Int[np.ndarray, " H"]
    at: Int[np.ndarray, " X"]
    place: Int[np.ndarray, " N"]
    values: Values


class Split(Protocol):
    """A split of kept faces."""

    @property
    def vertices(self) -> Int[np.ndarray, " X"]:
        """The vertex of the refined mesh at each corner of the split."""
        ...

    @property
    def counts(self) -> Int[np.ndarray, " Q"]:
        """Number of refined faces of each kept face."""
        ...

    def part(self, *chosen: slice) -> Split:
        """Return the split of some of the kept faces."""
        ...

    def rows(self, corners: Int[np.ndarray, " H"]) -> Rows:
        """Return the rows that rows at the corners of the kept faces become."""
        ...

    def faces(self, at: Shaped[np.ndarray, " X"]) -> Shaped[np.ndarray, "M 3"]:
        """Return labels at the corners of the refined faces, of those at corners of the split."""
        ...

    def wholes(self, at: Shaped[np.ndarray, " X"]) -> Shaped[np.ndarray, "F T"]:
        """Return `faces`, a row for those that show one side as a whole."""
        ...


@dataclass(frozen=True, eq=False)
class WholeLevels:
    """A split by whole levels of a base scheme.

    Attributes:
        base: the scheme.
        levels: how many.
        offsets: (Q + 1,) where the corners of each kept face begin.
        vertices: as of `Split`; of polygons' quads, which are then cut into triangles.
        known: `without_sides` of the control mesh's, if `vertices` are those of its own faces.
        places: (3 M,) the corners that are kept, where some faces are refined alone; None: all.
    """

    base: BaseScheme
    levels: int
    offsets: Int[np.ndarray, " Q1"]
    vertices: Int[np.ndarray, " X"]
    known: Sequence[Topology] = ()
    places: Int[np.ndarray, " P"] | None = None

    @property
    def counts(self) -> Int[np.ndarray, " Q"]:
        """Return how many refined faces each kept face has."""
        sizes = np.diff(self.offsets)
        if self.places is not None:
            return np.bincount(self.places // (3 * 4**self.levels), minlength=len(sizes)) // 3
        each = 4**self.levels
        return sizes * (each // 2) if self.base.polygons else np.full(len(sizes), each)

    def part(self, *chosen: slice) -> WholeLevels:
        """Return the split of some of the kept faces."""
        if sum(own.stop - own.start for own in chosen) == len(self.offsets) - 1:
            return self
        each, sizes, places = 4**self.levels, np.diff(self.offsets), self.places
        ends = [each * self.offsets[[own.start, own.stop]] for own in chosen]
        vertices = np.concatenate([self.vertices[begin:end] for begin, end in ends])
        offsets = np.append(0, np.cumsum(np.concatenate([sizes[own] for own in chosen])))
        if places is not None:
            whose = places // (3 * each) * (3 * each)
            starts = np.cumsum([0, *(end - begin for begin, end in ends)])
            cuts = [slice(*np.searchsorted(whose, own)) for own in ends]
            moves = starts[:-1] - [begin for begin, _ in ends]
            pairs = zip(cuts, moves, strict=True)
            places = np.concatenate([places[cut] + move for cut, move in pairs])
        return replace(self, offsets=offsets, vertices=vertices, known=(), places=places)

    def rows(self, corners: Int[np.ndarray, " H"]) -> Rows:
        """Return the rows that rows at the corners of the kept faces become."""
        topologies, blocks = self.known, Blocks(available_threads())
        if topologies and np.array_equal(topologies[0].corners, corners):
            at = self.vertices.astype(np.int32)
        else:
            count = int(corners.max()) + 1
            whole = self._topologies(corners, count, NO_CREASES)
            at = self.base.faces(whole[-1], blocks).reshape(-1).view(np.int32)
            topologies = without_sides(whole, self.base)
            del whole
        place, carrier = _places(at), Carrier(topologies, self.base, blocks=blocks)
        return Rows(corners, at, place, _Levels(carrier, corners, at, place))

    def faces(self, at: Shaped[np.ndarray, " X"]) -> Shaped[np.ndarray, "M 3"]:
        """Return labels at the corners of the refined faces, of those at corners of the split."""
        if self.places is not None:
            return at[self.places].reshape(-1, 3)
        if not self.base.polygons:
            return at.reshape(-1, 3)
        triangles = cut_quads(self.levels - 1).reshape(-1)
        return np.take(at.reshape(-1, 4**self.levels), triangles, axis=1).reshape(-1, 3)

    def wholes(self, at: Shaped[np.ndarray, " X"]) -> Shaped[np.ndarray, "F T"]:
        """Return `faces`, a row for those of a triangle before, or of half a quad of level 1."""
        faces, each = self.faces(at), 4 ** (self.levels - self.base.polygons)
        if self.places is not None:
            # Others have no area.
            every = np.full((len(self.counts), each, 3), faces[0, 0])
            every[np.arange(each) < self.counts[:, None]] = faces
            faces = every
        return faces.reshape(-1, 3 * each)

    def smooth(
        self,
        rows: Rows,
        vertex: Int[np.ndarray, " C"],
        creases: Creases,
        values: Shaped[np.ndarray, "C K"],
        *,
        limit: bool,
    ) -> Float[np.ndarray, "N K"]:
        """Refine values by the scheme's masks inside the charts that they form.

        Creases, which name edges by vertices of the control mesh, are creases of the charts too;
        `vertex` is that of each row.
        """
        of_corner, at_corner = vertex[rows.corners], values[rows.corners]
        points, first = chart_points(of_corner, at_corner)
        sharp = _in_charts(creases, points, self.offsets, of_corner[first])
        charts, blocks = self._topologies(points, len(first), sharp), Blocks(available_threads())
        column, corners = refine_charts(
            at_corner[first].astype(np.float64), charts, self.base, blocks, limit=limit
        )
        return column[corners.reshape(-1)[rows.place]]

    def _topologies(
        self, corners: Int[np.ndarray, " H"], count: int, creases: Creases
    ) -> list[Topology]:
        faces, blocks = (corners, self.offsets), Blocks(available_threads())
        return level_topologies(faces, count, self.levels, creases, self.base, blocks)


@dataclass(frozen=True, eq=False)
class _Levels:
    """Refines values of rows level by level."""

    carrier: Carrier
    corners: Int[np.ndarray, " H"]
    at: Int[np.ndarray, " X"]
    place: Int[np.ndarray, " N"]

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        return self.carrier.at_vertices(Column(values.astype(np.float64), rules.linear))

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Return values of nearest corners; of several that are as near, of the first row."""
        levels, count = len(self.carrier.topologies), len(values)
        if self.carrier.base.polygons:
            # A polygon's corner is nearest all over its quad.
            rows = np.full(len(self.place), count)
            np.minimum.at(rows, self.at, np.repeat(self.corners, 4**levels))
            return values[rows]
        weights = corner_weights(3, levels)
        nearest = weights == weights.max(axis=1, keepdims=True)
        face, place = np.divmod(self.place, len(weights))
        return values[
            np.where(nearest[place], self.corners.reshape(-1, 3)[face], count).min(axis=1)
        ]


@dataclass(frozen=True, eq=False)
class SeveralLevels:
    """A split into faces of several levels.

    Attributes:
        vertices: as of `Split`.
        counts: as of `Split`.
        weights: (M, 3, 3) the weights of the kept face's corners at each refined corner.
    """

    vertices: Int[np.ndarray, " X"]
    counts: Int[np.ndarray, " Q"]
    weights: Float[np.ndarray, "M 3 3"]

    def part(self, *chosen: slice) -> SeveralLevels:
        """Return the split of some of the kept faces."""
        ends = np.append(0, np.cumsum(self.counts))
        parts = (ends[[own.start, own.stop]].tolist() for own in chosen)
        faces = np.concatenate([np.arange(begin, end) for begin, end in parts])
        counts = np.concatenate([self.counts[own] for own in chosen])
        vertices = self.vertices.reshape(-1, 3)[faces].reshape(-1)
        return SeveralLevels(vertices, counts, self.weights[faces])

    def rows(self, corners: Int[np.ndarray, " H"]) -> Rows:
        """Return the rows that rows at the corners of the kept faces become."""
        of_faces = np.repeat(corners.reshape(-1, 3), self.counts, axis=0)
        made = join_corners(self.vertices.reshape(-1, 3), of_faces, self.weights)
        at = made.faces.reshape(-1)
        return Rows(corners, at, _places(at), made.blend)

    def faces(self, at: Shaped[np.ndarray, " X"]) -> Shaped[np.ndarray, "M 3"]:
        """Return labels at the corners of the refined faces."""
        return at.reshape(-1, 3)

    wholes = faces


def without_sides(topologies: Sequence[Topology], base: BaseScheme) -> list[Topology]:
    """Return topologies of what linear blends read: ends of edges, and corners of polygons.

    The first keeps all of its corners.
    """
    none = topologies[0].edges[:0, 0]
    sides = dict.fromkeys(("face_of_corner", "corner_edges", "half_edges", "edge_class"), none)
    first, *others = (replace(mesh, **sides, soft=NO_WEIGHTS) for mesh in topologies)
    return [first, *(m if base.polygons else replace(m, corners=none) for m in others)]


def whole_levels(
    kept: KeptFaces,
    refined: Int[np.ndarray, " Y"],
    levels: int,
    base: BaseScheme,
    known: Sequence[Topology],
) -> WholeLevels:
    """Return the split of kept faces, of which the surface has these corners after some levels.

    A copy of a face (double-sided modelling, decals) has the vertices of the refined face, in its
    own order of corners.
    """
    each, source = 4**levels, kept.source
    if np.array_equal(source, np.arange(len(kept.surface.corners))):
        return WholeLevels(base, levels, kept.offsets, refined, known)
    if base.polygons:
        vertices = refined.reshape(-1, each)[source]
        turned = np.repeat(kept.turned, np.diff(kept.offsets))
        if turned.any():
            vertices[turned] = vertices[turned][:, copied_corners((0, 3, 2, 1), levels - 1)]
    else:
        vertices = refined.reshape(-1, 3 * each)
        source = source.reshape(-1, 3)
        vertices = vertices[source[:, 0] // 3]
        orders = source % 3
        moved = np.flatnonzero((orders != [0, 1, 2]).any(axis=1))
        for order in np.unique(orders[moved], axis=0):
            rows = moved[(orders[moved] == order).all(axis=1)]
            vertices[rows] = vertices[rows][:, copied_corners(tuple(order.tolist()), levels)]
    return WholeLevels(base, levels, kept.offsets, vertices.reshape(-1))


def several_levels(
    kept: KeptFaces,
    faces: Int[np.ndarray, "F 3"],
    parents: Int[np.ndarray, " F"],
    weights: Float[np.ndarray, "F 3 3"],
) -> SeveralLevels:
    """Return the split of kept triangles into faces that have a parent each, ascending."""
    source = kept.source.reshape(-1, 3)
    begin, end = (np.searchsorted(parents, source[:, 0] // 3, side=s) for s in ("left", "right"))
    counts = end - begin
    own = ranges(begin, counts)
    order, over = (np.repeat(each, counts, axis=0) for each in (source % 3, kept.turned))
    weights, vertices = np.take_along_axis(weights[own], order[:, None], axis=2), faces[own]
    # A copy that faces the other way takes the corners backwards.
    weights[over], vertices[over] = weights[over][:, ::-1], vertices[over][:, ::-1]
    return SeveralLevels(vertices.reshape(-1), counts, weights)


def _places(at: Int[np.ndarray, " X"]) -> Int[np.ndarray, " N"]:
    """Return where each number is, the last time."""
    place = np.empty(int(at.max()) + 1, dtype=np.int64)
    place[at] = np.arange(len(at))
    return place


def _in_charts(
    creases: Creases,
    corners: Int[np.ndarray, " H"],
    offsets: Int[np.ndarray, " F1"],
    vertex: Int[np.ndarray, " P"],
) -> Creases:
    """Return the sides of faces over points of charts that lie on named pairs of vertices."""
    named = creases.named
    if named is None or len(named) == 0:
        return NO_CREASES
    sides = np.stack([corners, corners[following(offsets)]], axis=1)
    count = int(max(vertex.max(), named.max())) + 1
    ends, wanted = (np.sort(pairs, axis=1) @ [count, 1] for pairs in (vertex[sides], named))
    kept = np.isin(ends, wanted)
    if creases.soft_corners is not None:
        creases = replace(creases, soft_corners=creases.soft_corners[vertex])
    if creases.sharpness is None:
        return replace(creases, named=sides[kept])
    # Of a pair that is named twice the sharper one counts.
    order = np.lexsort((creases.sharpness, wanted))
    place = np.searchsorted(wanted[order], ends[kept], side="right") - 1
    return replace(creases, named=sides[kept], sharpness=creases.sharpness[order[place]])
