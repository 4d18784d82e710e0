"""A tree of faces: those that are split, and those that take their neighbours' vertices.

A face is split where its error is too large. Then, so that no vertex lies inside of another face's
side, a face beside finer ones takes all vertices on its sides as corners, and is filled with
triangles between these. It is split if that could be too far from the limit surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.adaptive.certificate import cut_distances, distances, folded, slabs
from pns_common.adaptive.outlines import Outlines, Written, triangles_in
from pns_common.adaptive.parts import (
    CHILDREN,
    NOT_THERE,
    Levels,
    Part,
    Refined,
    Settled,
    rows_of_faces,
)
from pns_common.adaptive.turning import chord, turns
from pns_common.kernels import connectivity as kernels
from pns_common.mesh.rows import cross, marked, ragged, unit
from pns_common.mesh.topology import TRIANGLE, Topology

# Faces that are measured between two reports of progress.
TOGETHER = 2**16
# Errors that agree in so many digits are equal.
DIGITS = 9
Measures = tuple[Float[np.ndarray, " F"], Float[np.ndarray, "F 3"], Float[np.ndarray, " F"]]
Flags = Sequence[Bool[np.ndarray, " _"]]
Codes = Sequence[Integer[np.ndarray, " _"]]


@dataclass(frozen=True)
class Goal:
    """The goal of a refinement; lengths in the mesh's units.

    Attributes:
        tolerance: no face is to be farther from the limit surface.
        angle: normals of no face are to turn more, in degrees.
        max_edge_length: no edge is to be longer.
        max_faces: so many faces at most, those of the largest errors split first.
    """

    tolerance: float | None = None
    angle: float | None = None
    max_edge_length: float | None = None
    max_faces: int | None = None

    def errors(
        self,
        distance: Float[np.ndarray, " N"],
        turns: Float[np.ndarray, " N"],
        triangles: Float[np.ndarray, "N K 3"],
    ) -> Float[np.ndarray, " N"]:
        """Return the errors of faces: above 1 where they are to be split.

        With nothing but ``max_faces`` they are distances.
        """
        parts = list[np.ndarray]()
        if self.tolerance is not None:
            parts.append(distance / self.tolerance)
        if self.angle is not None:
            parts.append(turns / chord(self.angle))
        if self.max_edge_length is not None:
            sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
            parts.append(sides.max(axis=1) / self.max_edge_length)
        return np.maximum.reduce(parts) if parts else distance


@dataclass(frozen=True, eq=False)
class Layer:
    """A level of a tree of faces.

    Attributes:
        part: the faces, and those around them.
        split: (F,) which faces are split.
        errors, slabs, turns: (F,), (F, 3), (F,) of those that exist; 0 elsewhere.
        middles: (E,) the name of the vertex on each edge at the next level, or NOT_THERE.
        step: from this level to the next; None at the last.
        settled: vertices that are in no level before.
    """

    part: Part
    split: Bool[np.ndarray, " F"]
    errors: Float[np.ndarray, " F"]
    slabs: Float[np.ndarray, "F 3"]
    turns: Float[np.ndarray, " F"]
    middles: Integer[np.ndarray, " E"]
    step: Refined | None
    settled: Sequence[Settled]


@dataclass(frozen=True, eq=False)
class Measured:
    """Faces of a level that exist: their codes, errors, slabs and turns."""

    codes: Integer[np.ndarray, " N"]
    errors: Float[np.ndarray, " N"]
    slabs: Float[np.ndarray, "N 3"]
    turns: Float[np.ndarray, " N"]


@dataclass(frozen=True, eq=False)
class Tree:
    """Faces of all levels.

    Attributes:
        layers: from the control mesh on.
        places: (N, 3) where named vertices are on the limit surface; NaN where none exists.
        middles_only: faces take new vertices in the middles of their sides alone: normals at others
            are not measured.
    """

    layers: Sequence[Layer]
    places: Float[np.ndarray, "N 3"]
    middles_only: bool = False

    @property
    def split(self) -> Flags:
        """The faces that are split, level by level."""
        return [layer.split for layer in self.layers]

    def codes(self, split: Flags) -> Codes:
        """Return the codes of flagged faces."""
        return [at.part.codes[own] for at, own in zip(self.layers, split, strict=True)]

    @property
    def measured(self) -> Sequence[Measured]:
        """Measurements of faces, level by level: they take less memory than the tree."""
        return [
            Measured(layer.part.codes[own], layer.errors[own], layer.slabs[own], layer.turns[own])
            for layer in self.layers
            for own in [layer.part.exists]
        ]

    def closed(self, split: Flags, widest: float | None = None) -> Flags:
        """Return the faces to split, so that the others can take all vertices on their sides.

        Args:
            split: faces that are split in any case, level by level; with a face its ancestors.
            widest: faces get new vertices only if they are no farther from the limit surface;
                None: any.
        """
        made, more, ties = [own.copy() for own in split], True, False
        if widest is None and not self.middles_only:
            return made
        while more or not ties:
            more, ties = False, not more
            for depth in reversed(range(len(made))):
                rows = self.beside(depth, made)
                given = self.outlines(made, depth, rows)
                far = np.zeros(len(rows), dtype=bool)
                if self.middles_only:
                    other = given.at * 2 % 1 > 0
                    far = np.bincount(given.owner[other], minlength=len(rows)) > 0
                if widest is not None:
                    far |= self.distances(depth, rows, given) > widest
                    # At last, so that the result does not depend on where the mesh is.
                    far |= self.filled(depth, rows, given)[2] if ties else False
                made[depth][rows[far]] = True
                more |= bool(far.any())
        return made

    def beside(self, depth: int, split: Flags) -> Integer[np.ndarray, " N"]:
        """Return the faces of a level that are not split and have new vertices on their sides."""
        layer, own = self.layers[depth], split[depth]
        mesh = layer.part.topology
        rows = np.flatnonzero(~own)
        rows = rows[sides_of(mesh, edges_of(layer, own), rows) > 0]
        return (
            rows[split[depth - 1][self.parents(depth, layer.part.codes[rows])]] if depth else rows
        )

    def outlines(self, split: Flags, depth: int, rows: Integer[np.ndarray, " N"]) -> Outlines:
        """Return faces of a level, which are not split, with the new vertices on their sides."""
        layer = self.layers[depth]
        mesh = layer.part.topology
        corners, offsets = ragged(mesh.offsets, rows)
        first = np.repeat(offsets[:-1], np.diff(offsets))
        here, place, size = np.arange(len(corners)), np.arange(len(corners)) - first + 0.0, 1.0
        own, at, names = [here], [place], [layer.part.names[mesh.corners[corners]]]
        while True:
            edges = layer.part.topology.corner_edges[corners].astype(np.int64)
            hit = edges_of(layer, split[depth])[edges]
            corners, here, place, size = corners[hit], here[hit], place[hit], size / 2
            if len(corners) == 0:
                break
            own.append(here)
            at.append(place + size)
            names.append(layer.middles[edges[hit]])
            if depth + 1 == len(self.layers):
                break
            # Each half is a side of the child at its end of the side.
            mesh, finer = layer.part.topology, self.layers[depth + 1].part
            codes = self.children_at(depth, np.stack([corners, after(mesh, corners)])).reshape(-1)
            found = np.minimum(np.searchsorted(finer.codes, codes), len(finer.codes) - 1)
            there, degree = (
                finer.codes[found] == codes,
                len(finer.topology.corners) // len(finer.codes),
            )
            corners = degree * found + np.repeat([0, degree - 1], len(corners))
            here, place = np.tile(here, 2), np.concatenate([place, place + size])
            corners, here, place = corners[there], here[there], place[there]
            depth += 1
            layer = self.layers[depth]
        every, places = np.concatenate(own), np.concatenate(at)
        order = np.lexsort([places, every])
        ended = np.concatenate([[0], np.cumsum(np.bincount(every, minlength=int(offsets[-1])))])
        return Outlines(np.concatenate(names)[order], places[order], ended[offsets])

    def children_at(
        self, depth: int, corners: Integer[np.ndarray, "*N"]
    ) -> Integer[np.ndarray, "*N"]:
        """Return the codes of faces' children at some corners."""
        rows, corner = np.divmod(corners, TRIANGLE)
        return CHILDREN * self.layers[depth].part.codes[rows] + corner

    def distances(
        self, depth: int, rows: Integer[np.ndarray, " N"], given: Outlines
    ) -> Float[np.ndarray, " N"]:
        """Return how far patches can be from faces of some outlines, however these are cut."""
        slabs, triangles = self.layers[depth].slabs[rows], self.triangles(depth, rows)
        there = np.where((given.names == NOT_THERE)[:, None], np.nan, self.places[given.names])
        return cut_distances(slabs, triangles, there, given.offsets)

    def triangles(self, depth: int, rows: Integer[np.ndarray, " N"]) -> Float[np.ndarray, "N 3 3"]:
        """Return the corners of faces."""
        part = self.layers[depth].part
        return self.places[part.names[part.topology.faces[rows]]]

    def parents(self, depth: int, codes: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, " N"]:
        """Return the rows of the parents of faces of a level in the level before."""
        return np.searchsorted(self.layers[depth - 1].part.codes, codes // CHILDREN)

    def order_of(
        self, depth: int, codes: Integer[np.ndarray, " N"], deepest: int
    ) -> Integer[np.ndarray, " N"]:
        """Return numbers of faces of a level, in the order of their parents."""
        return codes * CHILDREN ** (deepest - depth)

    def middles_of(self, depth: int, rows: Integer[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
        """Return the middles of faces."""
        return self.triangles(depth, rows).mean(axis=1)

    def count(self, split: Flags) -> int:
        """Return how many faces are written, of flags that are ``closed``."""
        written = self.layers[0].part.topology.face_count
        for depth, own in enumerate(split):
            rows = self.beside(depth, split)
            new = len(self.outlines(split, depth, rows).names) - TRIANGLE * len(rows)
            written += (CHILDREN - 1) * np.count_nonzero(own) + new
        return int(written)

    def written(self, depth: int, split: Flags) -> Written:
        """Return the faces of a level that are not split, filled where they have new vertices."""
        layer, there = self.layers[depth], ~split[depth]
        if depth:
            there &= split[depth - 1][self.parents(depth, layer.part.codes)]
        rows = np.flatnonzero(there)
        given, distance = self.outlines(split, depth, rows), distances(layer.slabs[rows])
        own, places, _ = self.filled(depth, rows, given)
        cut = np.flatnonzero(np.diff(given.offsets) > TRIANGLE)
        distance[cut] = self.distances(depth, rows[cut], given.some(cut))
        turns, codes = layer.turns[rows[own]], layer.part.codes[rows[own]]
        counts = np.full(len(own), TRIANGLE)
        return Written(given.names[places], given.at[places], counts, distance[own], turns, codes)

    def filled(
        self, depth: int, rows: Integer[np.ndarray, " N"], given: Outlines
    ) -> tuple[Integer[np.ndarray, " T"], Integer[np.ndarray, " H"], Bool[np.ndarray, " N"]]:
        """Return triangles that fill outlines: of which one each is, and places of their corners.

        Returns also which outlines could as well be filled otherwise.
        """
        sizes, (a, b, c) = np.diff(given.offsets), self.triangles(depth, rows).swapaxes(0, 1)
        normals, tied = unit(cross(b - a, c - a)), np.zeros(len(rows), dtype=bool)
        owners, pieces = list[np.ndarray](), list[np.ndarray]()
        for size in {TRIANGLE, *sizes.tolist()}:
            own = np.flatnonzero(sizes == size)
            begin = given.offsets[own][:, None]
            on = begin + np.arange(size)
            local, tied[own] = triangles_in(
                given.at[on], self.places[given.names[on]], normals[own]
            )
            owners.append(np.repeat(own, size - 2))
            pieces.append((local + begin[:, :, None]).reshape(-1, TRIANGLE))
        of, places = np.concatenate(owners), np.concatenate(pieces)
        order = np.argsort(of, kind="stable")
        return of[order], places[order].reshape(-1), tied


def edges_of(layer: Layer, split: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " E"]:
    """Return which edges are sides of split faces."""
    mesh = layer.part.topology
    own = np.repeat(split, np.diff(mesh.offsets))
    return marked(mesh.corner_edges[own], len(mesh.edges))


def sides_of(
    mesh: Topology, flags: Bool[np.ndarray, " E"], rows: Integer[np.ndarray, " N"]
) -> Integer[np.ndarray, " N"]:
    """Return how many sides of some triangles are flagged edges."""
    made = np.empty(len(rows), dtype=np.int8)
    kernels.count_sides(mesh.corner_edges, flags, rows, made)
    return made


def after(mesh: Topology, corners: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, " N"]:
    """Return the next corners of the same faces."""
    faces = mesh.face_of(corners).astype(np.int64)
    return np.where(corners + 1 == mesh.offsets[faces + 1], mesh.offsets[faces], corners + 1)


@dataclass(frozen=True, eq=False)
class Start:
    """The start of trees: a control mesh, rules and a goal.

    Attributes:
        control: the control mesh, whose faces all exist.
        first: the whole next level and the step to it, where it is made by more than masks.
        levels: the rules.
        goal: what is to be reached.
        tell: called with the share of a tree that is grown, and the faces that it has.
    """

    control: Part
    first: tuple[Part, Refined] | None
    levels: Levels
    goal: Goal
    tell: Callable[[float, int], None]
    tree: ClassVar[type[Tree]] = Tree
    together: ClassVar[int] = TOGETHER

    def grow(
        self,
        threshold: float,
        forced: Codes | None = None,
        *,
        only: bool = False,
        known: Sequence[Measured] = (),
    ) -> Tree:
        """Split the faces whose error is above a threshold, and those that are forced.

        Args:
            threshold: of errors.
            forced: codes of faces that are split in any case, level by level.
            only: split no others.
            known: faces that need not be measured again, level by level.
        """
        part, names, done = self.control, len(self.control.points), 0
        places, layers = np.full((names, 3), np.nan), list[Layer]()
        for depth in range(self.levels.deepest + 1):
            finer, step, middles, settled = None, None, self._no_middles(part), list[Settled]()
            if self.first is not None and depth == 0:
                finer, step = self.first
                middles = names + np.arange(len(part.topology.edges))
                places = _longer(places, len(finer.names) - names)
                settled = self._settle(finer, places)
            else:
                settled = self._settle(part, places)
            old = known[depth] if depth < len(known) else None
            there, count = int(part.exists.sum()), part.topology.face_count
            measured = errors, _, _ = np.zeros(count), np.zeros((count, 3)), np.zeros(count)
            seen, expected = 0, 0.0
            for rows in self._measure(part, places, finer, old, measured):
                seen, expected = seen + len(rows), expected + self._expected(errors[rows], depth)
                self._tell(done + seen, done + there * expected / seen, done + there)
            split = part.exists & (errors > threshold) & (not only)
            if forced is not None and depth < len(forced):
                split |= part.exists & np.isin(part.codes, forced[depth])
            split &= depth < self.levels.deepest
            if split.any():
                if finer is not None:
                    finer = replace(
                        finer, exists=np.repeat(split, self.levels.children(part.topology))
                    )
                else:
                    finer, step, middles = self.levels.split(part, split, names)
                    places = _longer(places, len(finer.names) - len(step.vertices))
                names = len(places)
            layers.append(Layer(part, split, *measured, middles, step, settled))
            done += there - int(split.sum())
            if finer is None or not split.any():
                break
            part = finer
        return self.tree(layers, places, self.goal.angle is not None)

    def _no_middles(self, part: Part) -> Integer[np.ndarray, " E"]:
        return np.full(len(part.topology.edges), NOT_THERE, dtype=np.int64)

    def _settle(self, part: Part, places: Float[np.ndarray, "N 3"]) -> list[Settled]:
        """Put vertices of faces that exist, and are not yet there, on the limit."""
        faces = rows_of_faces(part.topology, part.topology.corners)
        used = marked(faces[part.exists], len(part.points))
        if part.depth == 0 or (self.first is not None and part.depth == 1):
            used[:] = True  # vertices of no face are written too
        made = self.levels.settle(part, np.flatnonzero(used & np.isnan(places[part.names, 0])))
        for own in made:
            places[own.names] = own.limits
        return made

    def _measure(
        self,
        part: Part,
        places: Float[np.ndarray, "N 3"],
        finer: Part | None,
        known: Measured | None,
        to: Measures,
    ) -> Iterator[Integer[np.ndarray, " N"]]:
        """Write errors, slabs and turns of faces that exist; yield which, as they are written.

        They are measured on those of the next level if it is given. Those that are known are not
        measured again.
        """
        rows = np.flatnonzero(part.exists)
        if known is not None and len(known.codes):
            codes = part.codes[rows]
            there = np.minimum(np.searchsorted(known.codes, codes), len(known.codes) - 1)
            same = known.codes[there] == codes
            for own, old in zip(to, (known.errors, known.slabs, known.turns), strict=True):
                own[rows[same]] = old[there[same]]
            if same.any():
                yield rows[same]
            rows = rows[~same]
        if len(rows) == 0:
            return
        folds = folded(part)
        for begin in range(0, len(rows), self.together):
            some = rows[begin : begin + self.together]
            self._measure_some(part, places, finer, some, folds, to)
            yield some

    def _measure_some(
        self,
        part: Part,
        places: Float[np.ndarray, "P 3"],
        finer: Part | None,
        rows: Integer[np.ndarray, " N"],
        folds: Bool[np.ndarray, " E"],
        to: Measures,
    ) -> None:
        """Write errors, slabs and turns of some faces that exist; edges in ``folds`` are folded."""
        errors, widths, turned = to
        triangles, deeper = places[part.names[part.topology.faces[rows]]], finer is not None
        of_finer = CHILDREN * rows[:, None] + np.arange(CHILDREN) if deeper else rows
        sides, enough = folds[part.topology.face_edges[rows]], self.goal.tolerance or 0.0
        asked = triangles, sides, self.levels, int(deeper), enough
        widths[rows] = slabs(finer or part, of_finer, *asked)
        if self.goal.angle is not None:
            turned[rows] = turns(part, finer, rows, self.levels)
        errors[rows] = self.goal.errors(distances(widths[rows]), turned[rows], triangles)

    def _expected(self, errors: Float[np.ndarray, " N"], depth: int) -> float:
        """Return into how many faces some are going to be split, if four of one quarter errors."""
        most = CHILDREN ** (self.levels.deepest - depth)
        split = errors[errors > 1]
        return len(errors) - len(split) + float(np.clip(split, min(CHILDREN, most), most).sum())

    def _tell(self, done: int, expected: float, faces: int) -> None:
        """Report progress: faces that are measured, of those that are expected or asked for."""
        most = self.goal.max_faces
        if most is not None:
            expected, faces = most, min(faces, most)
        self.tell(min(done / expected, 1.0), faces)


def _longer(places: Float[np.ndarray, "N 3"], more: int) -> Float[np.ndarray, "M 3"]:
    """Return places of so many vertices more, of NaN."""
    return np.concatenate([places, np.full((more, 3), np.nan)])
