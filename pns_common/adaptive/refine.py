"""Refine a mesh until it is near enough to its limit surface, or has so many faces."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float, Integer

from pns_common.adaptive.parts import CHILD_WEIGHTS, CHILDREN, Levels, Part, Refined, Settled
from pns_common.adaptive.tree import (
    DIGITS,
    Flags,
    Goal,
    Start,
    Tree,
)
from pns_common.adaptive.turning import degrees
from pns_common.errors import MeshError, ParameterError
from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Mesh
from pns_common.mesh.rows import marked, ragged
from pns_common.operator.level import Level
from pns_common.operator.scheme import Scheme
from pns_common.parameters import is_number, is_whole
from pns_common.progress import Shares
from pns_common.refined import Refinement, Step, check_coordinates, reference_length_of
from pns_common.report import Report
from pns_common.schemes.limit import limit_normals, limit_positions
from pns_common.schemes.matrix import SubdivisionMatrix, mask_matrix, product

# Errors to which trees are grown fall by this at most from one to the next, and are always below
# the largest that is left.
SMALLER, BELOW = 1 / 4, 1 - 1e-9
# Errors whose ratio is this near to 1 are equal: networks compute in single precision.
EQUAL = 1e-4
# Faces of equal errors are split together if so large a share of the faces asked for is reached.
ENOUGH = 0.98
# Shares of the work, roughly: until the learned level is there, until trees have all their faces
# but those that closing adds, and until those to split are chosen.
LEARNED, GROWN, CHOSEN = 0.15, 0.65, 0.75


@dataclass(frozen=True, eq=False)
class Trail:
    """The way from values of control vertices to those of written ones.

    Attributes:
        steps: from each level to the next.
        settled: what ends on the limit at each level.
        rows: (W,) the written vertices' names.
        levels: the rules.
    """

    steps: list[Refined]
    settled: list[list[Settled]]
    rows: Integer[np.ndarray, " W"]
    levels: Levels

    @property
    def count(self) -> int:
        """Number of written vertices."""
        return len(self.rows)

    def __call__(self, values: Float[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Return values at the written vertices, by the base scheme's masks and limit masks."""
        made = np.zeros((int(self.rows.max(initial=-1)) + 1, values.shape[1]))
        base, blocks = self.levels.base, self.levels.blocks.quiet()
        for depth, settled in enumerate(self.settled):
            for own in settled:
                there = values
                for step in own.steps:
                    there = base.place(there[step.vertices], step.topology, blocks)[step.kept]
                ends = limit_positions(there, own.topology, blocks, base)[own.rows]
                known = own.names < len(made)
                made[own.names[known]] = ends[known]
            if depth < len(self.steps):
                step = self.steps[depth]
                values = base.place(values[step.vertices], step.topology, blocks)[step.kept]
        return made[self.rows]

    def normals(self) -> Float[np.ndarray, "W 3"]:
        """Return the normals of the limit surface at the written vertices."""
        made = np.zeros((int(self.rows.max(initial=-1)) + 1, 3))
        base, blocks = self.levels.base, self.levels.blocks.quiet()
        for own in chain.from_iterable(self.settled):
            known = own.names < len(made)
            turned = limit_normals(own.points, own.topology, blocks, base).vertices[own.rows]
            made[own.names[known]] = turned[known]
        return made[self.rows]

    def matrix(self, count: int) -> SubdivisionMatrix:
        """Return the matrix S with ``S @ values = carry(values)`` of ``count`` control vertices."""
        base, blocks = self.levels.base, self.levels.blocks.quiet()

        def follow(given: SubdivisionMatrix, step: Refined) -> SubdivisionMatrix:
            masks = mask_matrix(step.topology, base.place, blocks).take(step.kept)
            return product(masks, given.take(step.vertices))

        def to_limit(values: np.ndarray, mesh: Any, some: Any) -> np.ndarray:
            return limit_positions(values, mesh, some, base)

        every = np.arange(count)
        trunk = SubdivisionMatrix(every, every, np.ones(count), (count, count))
        parts, names = list[SubdivisionMatrix](), list[np.ndarray]()
        for depth, settled in enumerate(self.settled):
            for own in settled:
                there = trunk
                for step in own.steps:
                    there = follow(there, step)
                masks = mask_matrix(own.topology, to_limit, blocks).take(own.rows)
                parts.append(product(masks, there))
                names.append(own.names)
            if depth < len(self.steps):
                trunk = follow(trunk, self.steps[depth])
        firsts = np.cumsum([0, *(part.shape[0] for part in parts)])
        rows = np.concatenate(
            [first + part.rows for first, part in zip(firsts[:-1], parts, strict=True)]
        )
        whole = SubdivisionMatrix(
            rows,
            np.concatenate([part.columns for part in parts]),
            np.concatenate([part.weights for part in parts]),
            (int(firsts[-1]), count),
        )
        of_names = np.concatenate(names)
        order = np.argsort(of_names, kind="stable")
        return whole.take(order[np.searchsorted(of_names, self.rows, sorter=order)])


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AdaptiveRefinement(Refinement):
    """A refinement with faces of several levels.

    Attributes:
        codes: (F,) number of each face, or of that of which it is a piece, in its level.
        at: (H,) where each corner is on the outline of that face: k + t on the side from corner k
            on.
        face_levels: (F,) how often each face's parent was split.
        distances: (F,) no point of the part of the limit surface that a face stands for is farther
            from its plane, in the mesh's units; at sharp edges none from the edge.
        angles: (F,) how far shading turns over each face, in degrees; 0 where no angle was asked
            for.
        goal: what was asked for.
        trail: how values of control vertices become those of refined ones.
        control: the control mesh with its sharp edges.
    """

    codes: Integer[np.ndarray, " F"] = field(repr=False)
    at: Float[np.ndarray, " H"] = field(repr=False)
    face_levels: Integer[np.ndarray, " F"] = field(repr=False)
    distances: Float[np.ndarray, " F"] = field(repr=False)
    angles: Float[np.ndarray, " F"] = field(repr=False)
    goal: Goal
    trail: Trail = field(repr=False)
    control: Level = field(repr=False)

    @cached_property
    def face_parents(self) -> Integer[np.ndarray, " F"]:
        """The control face that each face is a part of."""
        return self.codes >> (2 * self.face_levels)

    @cached_property
    def weights(self) -> Float[np.ndarray, "F 3 3"]:
        """Weights of the control face's corners at each corner of a face.

        They are whole multiples of 2^-levels, and sum to 1.
        """
        codes, side, along = self.codes, self.at.astype(np.int64), (self.at % 1)[:, None]
        own, other = np.eye(3)[side], np.eye(3)[(side + 1) % 3]
        made = ((1 - along) * own + along * other).reshape(-1, 3, 3)
        for level in range(int(self.face_levels.max(initial=0))):
            rows = np.flatnonzero(self.face_levels > level)
            made[rows] = made[rows] @ CHILD_WEIGHTS[(codes[rows] >> (2 * level)) % CHILDREN]
        return made

    @cached_property
    def normals(self) -> Float[np.ndarray, "V 3"]:
        """(V, 3) exact normals of the limit surface, computed when they are first read."""
        return self.trail.normals()

    @cached_property
    def reference_length(self) -> float:
        """R, the unit of length of the budget."""
        return reference_length_of(self.control)

    @property
    def topologies(self) -> Any:
        """Raise: there is no whole mesh of each level."""
        raise MeshError("faces of several levels: use carry, weights or parents", element="faces")

    @cached_property
    def parents(self) -> SubdivisionMatrix:
        """The control vertices that each refined vertex is made of, with their weights."""
        return self.trail.matrix(len(self.control.points))

    def __repr__(self) -> str:
        vertices, faces = len(self.mesh.vertices), self.mesh.face_count
        return f"Refinement({self.scheme.name!r}, {self.goal}, {vertices=}, {faces=})"

    def carry(self, values: Float[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Return values of vertices at the refined ones, as ``parents @ values``."""
        return self.trail(np.asarray(values, dtype=np.float64))

    def at_corners(self, values: Float[np.ndarray, "H K"]) -> Float[np.ndarray, "F 3 K"]:
        """Return values of the control mesh's corners at corners of faces, linear in each face."""
        own = np.asarray(values, dtype=np.float64).reshape(-1, 3, values.shape[1])
        return self.weights @ own[self.face_parents]

    @cached_property
    def report(self) -> Report:
        """Counts and diagnostics; see ``Report``."""
        learned = [step for step in self.steps if step.added is not None]
        levels = np.bincount(self.face_levels)
        return {
            **self._report_of(learned, self.control.topology),
            "adaptive": {
                "tolerance": self.goal.tolerance,
                "angle": self.goal.angle,
                "max_edge_length": self.goal.max_edge_length,
                "max_faces": self.goal.max_faces,
                "vertices": len(self.mesh.vertices),
                "faces": self.mesh.face_count,
                "faces_by_level": levels.tolist(),
                "distance_max": float(self.distances.max(initial=0.0)),
                "angle_max": None
                if self.goal.angle is None
                else float(self.angles.max(initial=0.0)),
            },
        }


Made = TypeVar("Made", bound=AdaptiveRefinement)


def refine_to_goal(
    level: Level,
    first: Step | None,
    scheme: Scheme,
    creases: Creases,
    goal: Goal,
    deepest: int,
    shares: Shares,
) -> AdaptiveRefinement:
    """Refine a mesh to a goal.

    Args:
        level: the control mesh with its sharp edges.
        first: the first step, where the scheme's rule acts at it.
        scheme, creases: those of the refinement.
        goal: what is to be reached.
        deepest: the most levels that may be used.
        shares: what reports progress.
    """
    start = start_of(Start, level, first, scheme, creases, goal, deepest, shares)
    return written(AdaptiveRefinement, start, shares, level, first, scheme)


def start_of(
    kind: type[Start],
    level: Level,
    first: Step | None,
    scheme: Scheme,
    creases: Creases,
    goal: Goal,
    deepest: int,
    shares: Shares,
) -> Start:
    """Return the start of trees; arguments as of ``refine_to_goal``."""
    mesh = level.topology
    levels = Levels(scheme.base, level.blocks.quiet(), deepest, creases.levels)
    numbers, faces = np.arange(len(level.points)), np.arange(mesh.face_count)
    control = Part(0, mesh, level.points, numbers, faces, np.ones(len(faces), dtype=bool))
    start = kind(control, None, levels, goal, shares.reach)
    if first is not None:
        every = np.arange(len(first.points))
        topology = scheme.base.split(mesh, levels.blocks, inherit=levels.inherit(1))
        codes = np.arange(topology.face_count)
        finer = Part(1, topology, first.points, every, codes, np.ones(len(codes), dtype=bool))
        start = replace(start, first=(finer, Refined(numbers, mesh, every)))
    return start


def tree_of(start: Start, shares: Shares) -> Tree:
    """Return the tree that reaches the goal of a start."""
    shares.part(LEARNED if start.first is not None else 0.0, GROWN)
    find = _near_enough if start.goal.max_faces is None else _with_so_many
    return find(start, shares)


def _near_enough(start: Start, shares: Shares) -> Tree:
    """Return a tree that reaches the tolerance, and whose faces can be cut to meet."""
    tree, left = start.grow(1.0), 1 - GROWN
    while True:
        closed = tree.closed(tree.split, start.goal.tolerance)
        if _same(tree.split, closed):
            return tree
        forced, known = tree.codes(closed), tree.measured
        del tree, closed
        # Each time fewer faces are new.
        shares.part(1 - left, 1 - left / 4)
        left /= 4
        tree = start.grow(1.0, forced, known=known)


def _with_so_many(start: Start, shares: Shares) -> Tree:
    """Return a tree of so many faces as are asked for, or fewer."""
    goal, tree = start.goal, start.grow(np.inf)
    most, bounds = goal.max_faces or 0, (goal.tolerance, goal.angle, goal.max_edge_length)
    threshold, least = math.inf, 0.0 if bounds == (None, None, None) else 1.0
    while True:
        made = tree.count(tree.closed(tree.split))
        left = _largest_left(tree, start.levels.deepest)
        if made > most or left <= least:
            break
        threshold = max(min(threshold * max(SMALLER, made / most), left * BELOW), least)
        known = tree.measured
        del tree
        tree = start.grow(threshold, known=known)
    order, errors = _worst_first(tree)
    ends = _ends_of_ties(errors)
    shares.part(GROWN, CHOSEN)
    chosen, count = _as_many(tree, order, ends, most, made, shares)
    if count < ENOUGH * most and len(ends) < len(order):
        chosen, _ = _as_many(tree, order, np.arange(1, len(order) + 1), most, made, shares)
    shares.part(CHOSEN, 1.0)
    forced, known = tree.codes(tree.closed(_flagged(tree, order[:chosen]))), tree.measured
    del tree
    return start.grow(threshold, forced, only=True, known=known)


def _as_many(
    tree: Tree,
    order: Integer[np.ndarray, "N 2"],
    ends: Integer[np.ndarray, " M"],
    most: int,
    made_by_all: int,
    shares: Shares,
) -> tuple[int, int]:
    """Return the largest of some numbers of first splits that makes so many faces at most.

    0 is one of them. Returns also how many faces it makes; all make ``made_by_all``.
    """

    def count(number: int) -> int:
        return tree.count(tree.closed(_flagged(tree, order[: ends[number - 1]])))

    low, fewer, turn = 0, tree.layers[0].part.topology.face_count, 0
    high, more = len(ends), made_by_all
    if more <= most:
        low, fewer = high, more
    while high - low > 1:
        # Faces are nearly proportional to splits; each third time the middle, so that it ends.
        turn, share = turn + 1, (most - fewer) / (more - fewer) if turn % 3 < 2 else 1 / 2
        middle = min(max(low + int(share * (high - low)), low + 1), high - 1)
        made = count(middle)
        if made <= most:
            low, fewer = middle, made
        else:
            high, more = middle, made
        shares.reach(1 - (high - low).bit_length() / len(ends).bit_length(), fewer)
    return int(ends[low - 1]) if low else 0, fewer


def _ends_of_ties(errors: Float[np.ndarray, " N"]) -> Integer[np.ndarray, " M"]:
    """Return where errors, largest first, end that are equal."""
    falls = errors[1:] * (1 + EQUAL) < errors[:-1]
    return np.append(np.flatnonzero(falls) + 1, len(errors)) if len(errors) else np.zeros(0, int)


def _largest_left(tree: Tree, deepest: int) -> float:
    """Return the largest error of faces that are not split and could be."""
    errors = (
        layer.errors[layer.part.exists & ~layer.split].max(initial=0.0)
        for layer in tree.layers[:deepest]
    )
    return float(max(errors))


def _worst_first(tree: Tree) -> tuple[Integer[np.ndarray, "N 2"], Float[np.ndarray, " N"]]:
    """Return depth and row of split faces, and errors, largest first; equal ones by place."""
    errors, above = [layer.errors.copy() for layer in tree.layers], list[np.ndarray]()
    for depth in range(len(errors) - 1, 0, -1):
        # A face is not better than its children, so that none comes before its parent.
        part = tree.layers[depth].part
        rows = np.flatnonzero(part.exists)
        np.maximum.at(errors[depth - 1], tree.parents(depth, part.codes[rows]), errors[depth][rows])
    at, values, middles = above, list[np.ndarray](), list[np.ndarray]()
    for depth, layer in enumerate(tree.layers):
        rows = np.flatnonzero(layer.split)
        at.append(np.stack([np.full(len(rows), depth), rows], axis=1))
        values.append(errors[depth][rows])
        middles.append(tree.middles_of(depth, rows))
    places, error = np.concatenate(middles), np.concatenate(values)
    size = np.abs(places).max(initial=0.0) or 1.0
    keys = np.round(places / size, DIGITS)
    order = np.lexsort([*keys.T[::-1], np.concatenate(at)[:, 0], -_shortened(error)])
    return np.concatenate(at)[order], error[order]


def _shortened(values: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return values of DIGITS digits."""
    with np.errstate(divide="ignore"):
        scale = 10.0 ** (DIGITS - np.ceil(np.log10(values)))
    return np.where(values > 0, np.round(values * scale) / scale, 0.0)


def _flagged(tree: Tree, rows: Integer[np.ndarray, "N 2"]) -> Flags:
    return [
        marked(rows[rows[:, 0] == depth, 1], len(layer.split))
        for depth, layer in enumerate(tree.layers)
    ]


def _same(one: Flags, other: Flags) -> bool:
    return all(bool((a == b).all()) for a, b in zip(one, other, strict=True))


# --- writing --------------------------------------------------------------------------------------


def written(
    kind: type[Made], start: Start, shares: Shares, level: Level, first: Step | None, scheme: Scheme
) -> Made:
    """Grow the tree of a start, and return its refinement; arguments as of ``refine_to_goal``."""
    tree, levels = tree_of(start, shares), start.levels
    made = [tree.written(depth, tree.split) for depth in range(len(tree.layers))]
    # In the order of control faces, and of children in each.
    keys = [tree.order_of(depth, own.codes, levels.deepest) for depth, own in enumerate(made)]
    order = np.argsort(np.concatenate(keys), kind="stable")
    names, at, counts, distance, turned, codes = (
        np.concatenate([getattr(own, name) for own in made])
        for name in ("names", "at", "counts", "distances", "turns", "codes")
    )
    places, offsets = ragged(np.append(0, np.cumsum(counts)), order)
    names, at = names[places], at[places]
    depths = np.repeat(np.arange(len(made)), [len(own.codes) for own in made])[order]
    used = marked(names, len(tree.places))
    used[: len(level.points)] = True
    rows, number = np.flatnonzero(used), np.cumsum(used) - 1
    settled = [list(layer.settled) for layer in tree.layers]
    if first is not None:
        # The control mesh's vertices and the first new ones end there together, a level later.
        after = settled[1] if len(settled) > 1 else []
        settled = [[], settled[0] + after, *settled[2:]]
    steps = [layer.step for layer in tree.layers if layer.step is not None]
    points, corners = tree.places[rows], number[names]
    check_coordinates(points, levels.blocks)
    nothing = np.broadcast_to(0.0, len(rows))
    return kind(
        mesh=Mesh.of_refined(points, corners, offsets)
        if scheme.base.polygons
        else Mesh.of_refined(points, corners.reshape(-1, 3)),
        ratio=nothing,
        gate=nothing,
        steps=[] if first is None else [first],
        scheme=scheme,
        surface=None,
        codes=codes[order],
        at=at,
        face_levels=depths,
        distances=distance[order],
        angles=degrees(turned[order]),
        goal=start.goal,
        trail=Trail(steps, settled, rows, levels),
        control=level,
    )


# --- arguments ------------------------------------------------------------------------------------


def goal_of(mesh: Mesh, tolerance: Any, angle: Any, max_faces: Any, max_edge_length: Any) -> Goal:
    """Return what a refinement is to reach.

    Raises:
        ParameterError: a length or an angle that is not above 0, an angle of 180 degrees or more,
            or fewer faces than the mesh has.
    """
    if max_faces is not None and not (is_whole(max_faces) and max_faces >= mesh.face_count):
        expected = f"a whole number, at least {mesh.face_count}: faces are split, never joined"
        raise ParameterError("max_faces", max_faces, expected=expected)
    if angle is not None and not (is_number(angle) and 0 < float(angle) < 180):
        raise ParameterError("angle", angle, expected="degrees, above 0 and below 180")
    return Goal(
        _length(mesh, "tolerance", tolerance),
        None if angle is None else float(angle),
        _length(mesh, "max_edge_length", max_edge_length),
        None if max_faces is None else int(max_faces),
    )


def _length(mesh: Mesh, name: str, given: Any) -> float | None:
    """Return a length in the mesh's units, of a number or a share of its diagonal."""
    if given is None:
        return None
    value, unit = given, 1.0
    if isinstance(given, str):
        text = given.strip()
        with suppress(ValueError):
            value = float(text.removesuffix("%"))
        if text.endswith("%"):
            used = mesh.vertices[np.unique(mesh.corners)]
            unit = float(np.linalg.norm(np.ptp(used, axis=0))) / 100 if len(used) else 1.0
    if not (is_number(value) and float(value) > 0):
        expected = "a length above 0, or a share of the diagonal, as 0.1%"
        raise ParameterError(name, given, expected=expected)
    return float(value) * unit
