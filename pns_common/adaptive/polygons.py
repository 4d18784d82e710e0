"""A tree of polygons over Catmull–Clark's scheme, and what is written of it.

A polygon is split, into a quad for each corner, where its error is too large. Quads that meet
differ by one level at most, so a quad has at most one new vertex inside of each side: it is cut in
triangles and quads by a fixed pattern, or split where all its sides have one. Other vertices than
these are not needed, so nothing spreads. A face of the control mesh may have any number of new
vertices on its sides: where it is flat enough it takes them as corners, so lids stay whole.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.adaptive.certificate import HIGH, LOW, SIDE
from pns_common.adaptive.outlines import Outlines, Written
from pns_common.adaptive.parts import CHILDREN, Part
from pns_common.adaptive.quad_certificate import (
    DEEPER,
    QUAD,
    Patches,
    Sides,
    lines,
    near_enough,
    planes,
)
from pns_common.adaptive.tree import Flags, Measures, Start, Tree, edges_of
from pns_common.kernels import connectivity
from pns_common.mesh.rows import dot, marked, ragged
from pns_common.mesh.topology import TRIANGLE, Topology, following

# Of two faces at a side, that which is farther from its patch is split for the side; both if equal.
EQUAL = 1 - 1e-9


@dataclass(frozen=True, eq=False)
class PolygonTree(Tree):
    """A tree whose faces are polygons, and quads from the first level on."""

    def children_at(
        self, depth: int, corners: Integer[np.ndarray, "*N"]
    ) -> Integer[np.ndarray, "*N"]:
        """Return the codes of faces' children at some corners."""
        if depth == 0:
            return corners
        rows, corner = np.divmod(corners, QUAD)
        return CHILDREN * self.layers[depth].part.codes[rows] + corner

    def distances(
        self, depth: int, rows: Integer[np.ndarray, " N"], given: Outlines
    ) -> Float[np.ndarray, " N"]:
        """Return how far patches can be from faces of some outlines, however these are cut."""
        slabs, frames = self.layers[depth].slabs[rows], self.frames(depth, rows)
        counts = np.diff(given.offsets)
        away = self.places[given.names] - np.repeat(frames[:, :3], counts, axis=0)
        heights = dot(away, np.repeat(frames[:, 3:], counts, axis=0))
        low, high = (by.reduceat(heights, given.offsets[:-1]) for by in (np.minimum, np.maximum))
        sizes = np.maximum(slabs[:, HIGH] - low, high - slabs[:, LOW])
        return np.maximum(sizes, slabs[:, SIDE])

    def frames(self, depth: int, rows: Integer[np.ndarray, " N"]) -> Float[np.ndarray, "N 6"]:
        """Return the planes of faces."""
        part = self.layers[depth].part
        corners, counts = padded(part.topology, rows)
        return planes(self.places[part.names[part.topology.corners[corners]]], counts)

    def closed(self, split: Flags, widest: float | None = None) -> Flags:
        """Return the faces to split, so that the others can be cut or take the others' vertices.

        Args:
            split: faces that are split in any case, level by level; with a face its ancestors.
            widest: faces get new vertices only if they are no farther from the limit surface;
                None: any.
        """
        made = [own.copy() for own in split]
        for depth in reversed(range(len(made))):
            own, layer = made[depth], self.layers[depth]
            while True:
                sides = self.sides(depth, made)
                more = (sides == QUAD) if depth else np.zeros(len(own), dtype=bool)
                if widest is not None:
                    rows = np.flatnonzero((sides > 0) & ~more & ~own & layer.part.exists)
                    if len(rows):
                        given = self.outlines(made, depth, rows)
                        more[rows] = self.distances(depth, rows, given) > widest
                more &= ~own
                if not more.any():
                    break
                own |= more
            if depth:
                # Quads exist, or are split or cut, only where their parents are split.
                asked = own | (sides > 0) if depth > 1 else own
                made[depth - 1][self.parents(depth, layer.part.codes[asked])] = True
        return made

    def sides(self, depth: int, split: Flags) -> Integer[np.ndarray, " F"]:
        """Return how many sides of each face have a new vertex."""
        layer = self.layers[depth]
        mesh = layer.part.topology
        hit = edges_of(layer, split[depth])[mesh.corner_edges]
        return np.add.reduceat(hit, mesh.offsets[:-1], dtype=np.int64)

    def order_of(
        self, depth: int, codes: Integer[np.ndarray, " N"], deepest: int
    ) -> Integer[np.ndarray, " N"]:
        """Return numbers of faces of a level, in the order of their parents."""
        own = codes if depth else self.layers[0].part.topology.offsets[codes].astype(np.int64)
        return own * CHILDREN ** (deepest - max(depth, 1))

    def middles_of(self, depth: int, rows: Integer[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
        """Return the middles of faces."""
        return self.frames(depth, rows)[:, :3]

    def parents(self, depth: int, codes: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, " N"]:
        """Return the rows of parents in the level before."""
        above = self.layers[depth - 1].part
        if depth == 1:
            return above.topology.face_of(codes).astype(np.int64)
        return np.searchsorted(above.codes, codes // CHILDREN)

    def count(self, split: Flags) -> int:
        """Return how many faces are written, of flags that are ``closed``."""
        return sum(len(self.written(depth, split).counts) for depth in range(len(self.layers)))

    def written(self, depth: int, split: Flags) -> Written:
        """Return the faces of a level that are not split, cut where they have new vertices."""
        layer, there = self.layers[depth], ~split[depth]
        if depth:
            there &= split[depth - 1][self.parents(depth, layer.part.codes)]
        there = np.flatnonzero(there)
        given = self.outlines(split, depth, there)
        distance = self.distances(depth, there, given)
        degree = np.diff(layer.part.topology.offsets)[there]
        corner_count, half = np.diff(given.offsets), given.at % 1
        # A pattern for triangles and quads with a vertex in the middle of some sides.
        alone = (half == 0) | (half == 1 / 2)
        fits = np.logical_and.reduceat(alone, given.offsets[:-1]) & (degree <= QUAD)
        fits &= corner_count < 2 * QUAD
        bits = np.where(half == 1 / 2, 1 << np.minimum(given.at, 60).astype(np.int64), 0)
        kind = np.where(fits, np.add.reduceat(bits, given.offsets[:-1]), -1)
        rows = np.flatnonzero(~fits | (kind == 0))
        places, offsets = ragged(given.offsets, rows)
        pieces = [(rows, places, np.diff(offsets))]
        for n in (TRIANGLE, QUAD):
            for pattern in range(1, 2**n - (n == QUAD)):
                rows = np.flatnonzero((kind == pattern) & (degree == n))
                if len(rows) == 0:
                    continue
                table, counts = cut(n, pattern)
                first = given.offsets[rows][:, None] + table
                every = np.repeat(rows, len(counts)), np.tile(counts, len(rows))
                pieces.append((every[0], first.reshape(-1), every[1]))
        own, places, counts = (np.concatenate(each) for each in zip(*pieces, strict=True))
        order = np.argsort(own, kind="stable")
        moved, _ = ragged(np.concatenate([[0], np.cumsum(counts)]), order)
        places, own = places[moved], own[order]
        turns, codes = layer.turns[there[own]], layer.part.codes[there[own]]
        return Written(
            given.names[places], given.at[places], counts[order], distance[own], turns, codes
        )


@cache
def cut(n: int, pattern: int) -> tuple[Integer[np.ndarray, " M"], Integer[np.ndarray, " K"]]:
    """Return places on the outline of a face's pieces, and how many corners each has.

    The face has ``n`` corners, and a vertex in the middle of side k where bit k is set. Corners
    between two of these are cut off, and what is left of quads is cut as far as to triangles and
    quads.
    """
    outline = list[int]()
    for side in range(n):
        outline += [side, n + side] if pattern >> side & 1 else [side]
    cut_off = [k for k in range(n) if pattern >> k & 1 and pattern >> (k - 1) % n & 1]
    pieces = [[n + (k - 1) % n, k, n + k] for k in cut_off]
    left = [point for point in outline if point not in cut_off]
    sides = [k for k in range(n) if pattern >> k & 1]
    if n == QUAD and len(sides) == 1:
        k = sides[0]
        pieces += [[n + k, (k + j) % n, (k + j + 1) % n] for j in (1, 2, 3)]
    elif n == TRIANGLE and len(sides) == 1:
        k = sides[0]
        pieces += [[n + k, (k + j) % n, (k + j + 1) % n] for j in (1, 2)]
    elif n == QUAD and len(sides) == 2 and not cut_off:
        k = sides[0]
        pieces += [[k, n + k, n + k + 2, (k + 3) % n], [n + k, k + 1, k + 2, n + k + 2]]
    elif n == QUAD and len(sides) == 2:
        k, far = cut_off[0], (cut_off[0] + 2) % n
        before, after = n + (k - 1) % n, n + k
        pieces += [[before, after, far], [after, (k + 1) % n, far], [(k - 1) % n, before, far]]
    elif n == QUAD and len(sides) == 3:
        k = next(k for k in sides if len({k, (k - 1) % n, (k + 1) % n} & set(sides)) == 3)
        pieces += [
            [n + (k - 1) % n, n + k, n + (k + 1) % n],
            [point for point in left if point != n + k],
        ]
    else:
        pieces.append(left)
    place = {point: row for row, point in enumerate(outline)}
    table = np.array([place[point] for piece in pieces for point in piece])
    return table, np.array([len(piece) for piece in pieces])


@dataclass(frozen=True, eq=False)
class PolygonStart(Start):
    """The start of trees of polygons."""

    tree = PolygonTree
    # A side's error goes to one of the two faces at it, so all are looked at.
    together = sys.maxsize

    def _measure_some(
        self,
        part: Part,
        places: Float[np.ndarray, "P 3"],
        finer: Part | None,
        rows: Integer[np.ndarray, " N"],
        folds: Bool[np.ndarray, " E"],
        to: Measures,
    ) -> None:
        (errors, slabs, turns), new = to, rows
        mesh, enough = part.topology, self.goal.tolerance or 0.0
        steps, rows = DEEPER - (finer is not None), np.flatnonzero(part.exists)
        asked = marked(new, mesh.face_count)
        fresh = asked[rows]
        corners, counts = padded(mesh, rows)
        points = places[part.names[mesh.corners[corners]]]
        frames = planes(points, counts)
        if finer is None:
            patches = Patches(part, new, np.arange(len(new) + 1), inside=False)
        else:  # all faces of the control mesh
            quads = np.arange(len(mesh.corners))
            patches = Patches(finer, quads, mesh.offsets.astype(np.int64), inside=True)
        slabs[new, :SIDE] = near_enough(patches, frames[fresh], self.levels, enough, steps)
        heights = dot(points - frames[:, None, :3], frames[:, None, 3:])
        flat = np.maximum(
            slabs[rows, HIGH] - heights.min(axis=1), heights.max(axis=1) - slabs[rows, LOW]
        )
        sides = self._side_distances(part, places, finer, rows, flat, frames, steps, asked, folds)
        slabs[new, SIDE] = sides[new]
        distance = np.maximum(flat[fresh], slabs[new, SIDE])
        errors[new] = self.goal.errors(distance, turns[new], points[fresh])

    def _side_distances(
        self,
        part: Part,
        places: Float[np.ndarray, "P 3"],
        finer: Part | None,
        rows: Integer[np.ndarray, " N"],
        flat: Float[np.ndarray, " N"],
        frames: Float[np.ndarray, "N 6"],
        steps: int,
        wanted: Bool[np.ndarray, " F"],
        folds: Bool[np.ndarray, " E"],
    ) -> Float[np.ndarray, " F"]:
        """Return how far sides can be from their curves, beyond which no slab bounds these."""
        mesh, distance = part.topology, np.zeros(part.topology.face_count)
        rim = mesh.edge_class == connectivity.BOUNDARY
        rim |= mesh.edge_class == connectivity.IRREGULAR
        asked = folds[mesh.corner_edges]
        owner = mesh.face_of(np.arange(len(mesh.corners))).astype(np.int64)
        asked &= wanted[owner]
        corners = np.flatnonzero(asked)
        if len(corners) == 0:
            return distance
        ends = mesh.corners[np.stack([corners, following(mesh.offsets)[corners]])]
        begin, end = places[part.names[ends]]
        number = np.zeros(mesh.face_count, dtype=np.int64)
        number[rows] = np.arange(len(rows))
        across = lines(begin, end, frames[number[owner[corners]], 3:])
        if finer is None:
            sides = Sides(part, corners[:, None])
        else:
            after = following(mesh.offsets)[corners]
            sides = Sides(finer, QUAD * np.stack([corners, after], 1) + [0, QUAD - 1])
        enough = self.goal.tolerance or 0.0
        found = near_enough(sides, across, self.levels, enough, steps)
        # The farther face of two is split for the side.
        size, edges = np.zeros(mesh.face_count), mesh.corner_edges[corners]
        size[rows] = flat
        most = np.zeros(len(mesh.edges))
        np.maximum.at(most, mesh.corner_edges, size[owner])
        counts = rim[edges] | (size[owner[corners]] >= EQUAL * most[edges])
        np.maximum.at(distance, owner[corners[counts]], found[counts])
        return distance


def padded(
    mesh: Topology, rows: Integer[np.ndarray, " N"]
) -> tuple[Integer[np.ndarray, "N M"], Integer[np.ndarray, " N"]]:
    """Return the corners of faces, the first again where there are fewer; and how many they are."""
    counts = np.diff(mesh.offsets)[rows].astype(np.int64)
    each = np.arange(int(counts.max(initial=TRIANGLE)))
    return mesh.offsets[rows][:, None] + np.where(each < counts[:, None], each, 0), counts
