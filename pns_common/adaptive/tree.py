"""A tree of faces: those that are split, and cuts where neighbours of two levels meet.

A face is split where its error is too large. Then, so that no vertex lies inside of another face's
side, neighbours differ by one level at most: a face beside one that is split is cut in two, from
the new vertex to the corner opposite; with two such sides it is split too. So there is nothing to
choose, and the result does not depend on numbering.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.adaptive.certificate import cut_distances, distances, folded, slabs
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
from pns_common.mesh.rows import marked
from pns_common.mesh.topology import Topology

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
    """

    layers: Sequence[Layer]
    places: Float[np.ndarray, "N 3"]

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
        """Return the faces to split, so that the others can be cut to meet them.

        Args:
            split: faces that are split in any case, level by level; with a face its ancestors.
            widest: faces are cut in two only if both parts are no farther from the limit surface;
                None: any.
        """
        made = [own.copy() for own in split]
        for depth in reversed(range(len(made))):
            layer, own = self.layers[depth], made[depth]
            mesh, hit, every = layer.part.topology, edges_of(layer, own), np.arange(len(own))
            rows, edges = every, mesh.face_edges
            while True:
                sides = sides_of(mesh, hit, rows)
                more = sides > 1
                if widest is not None:
                    cut = np.flatnonzero((sides == 1) & ~own[rows] & layer.part.exists[rows])
                    more[cut] = self.cut_distances(depth, rows[cut], hit) > widest
                new = rows[more & ~own[rows]]
                if len(new) == 0:
                    break
                own[new] = True
                fresh = marked(edges[new], len(hit)) & ~hit
                hit |= fresh
                rows = np.flatnonzero(sides_of(mesh, fresh, every))
            if depth:
                # Such a face exists, or is split or cut, only where its parent is split.
                asked = layer.part.codes[own | (sides_of(mesh, hit, every) > 0)] // CHILDREN
                above = self.layers[depth - 1].part.codes
                made[depth - 1][np.searchsorted(above, asked)] = True
        return made

    def parents(self, depth: int, codes: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, " N"]:
        """Return the rows of the parents of faces of a level in the level before."""
        return np.searchsorted(self.layers[depth - 1].part.codes, codes // CHILDREN)

    def middles_of(self, depth: int, rows: Integer[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
        """Return the middles of faces."""
        part = self.layers[depth].part
        return self.places[part.names[part.topology.faces[rows]]].mean(axis=1)

    def cut_distances(
        self, depth: int, rows: Integer[np.ndarray, " N"], hit: Bool[np.ndarray, " E"]
    ) -> Float[np.ndarray, " N"]:
        """Return how far the limit surface can be from faces of one flagged edge, cut in two."""
        layer = self.layers[depth]
        mesh, names = layer.part.topology, layer.part.names
        edge = mesh.face_edges[rows, hit[mesh.face_edges[rows]].argmax(axis=1)]
        middle = layer.middles[edge]
        there = np.where((middle == NOT_THERE)[:, None], np.nan, self.places[middle])
        return cut_distances(layer.slabs[rows], self.places[names[mesh.faces[rows]]], there)

    def count(self, split: Flags) -> int:
        """Return how many faces are written, of flags that are ``closed``."""
        written = self.layers[0].part.topology.face_count
        for layer, own in zip(self.layers, split, strict=True):
            cut = sides_of(layer.part.topology, edges_of(layer, own), np.flatnonzero(~own))
            written += (CHILDREN - 1) * np.count_nonzero(own) + np.count_nonzero(cut)
        return int(written)


def edges_of(layer: Layer, split: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " E"]:
    """Return which edges are sides of split faces."""
    mesh = layer.part.topology
    return marked(mesh.face_edges[split], len(mesh.edges))


def sides_of(
    mesh: Topology, flags: Bool[np.ndarray, " E"], rows: Integer[np.ndarray, " N"]
) -> Integer[np.ndarray, " N"]:
    """Return how many sides of some faces are flagged edges."""
    made = np.empty(len(rows), dtype=np.int8)
    kernels.count_sides(mesh.corner_edges, flags, rows, made)
    return made


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
        return self.tree(layers, places)

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
        for begin in range(0, len(rows), self.together):
            some = rows[begin : begin + self.together]
            self._measure_some(part, places, finer, some, to)
            yield some

    def _measure_some(
        self,
        part: Part,
        places: Float[np.ndarray, "P 3"],
        finer: Part | None,
        rows: Integer[np.ndarray, " N"],
        to: Measures,
    ) -> None:
        """Write errors, slabs and turns of some faces that exist."""
        errors, widths, turned = to
        triangles, deeper = places[part.names[part.topology.faces[rows]]], finer is not None
        of_finer = CHILDREN * rows[:, None] + np.arange(CHILDREN) if deeper else rows
        asked = triangles, folded(part)[rows], self.levels, int(deeper), self.goal.tolerance or 0.0
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
