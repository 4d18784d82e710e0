"""Bounds of the distance between polygons with corners on the limit surface and their patches.

The patch of a polygon is the part of the limit surface of Catmull–Clark's scheme that it becomes.
Its heights over a plane through the polygon are bounded by control points around the quads that the
polygon becomes, up to ``DEEPER`` levels later (kernels/quad_flatness.py).
docs/explanation/adaptive.md proves the bounds, and says what they promise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Integer

from pns_common.adaptive.parts import CHILDREN, Levels, Part
from pns_common.kernels import connectivity
from pns_common.kernels import quad_flatness as kernels
from pns_common.mesh.rows import cross, dot, marked, ragged, unit
from pns_common.mesh.topology import NO_WEIGHTS

# Control points are tried so many levels later, until they are near enough, or FAR from it.
DEEPER, FAR = 2, 8.0
# So many patches, or sides, are looked into at once.
TOGETHER = 2**13
QUAD = kernels.QUAD
# The parts of a side of a quad: the sides of its children, and of which child after the side's own.
HALVES = (0, 0), (1, QUAD - 1)


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches as quads of a part of a level.

    Attributes:
        part: the quads.
        rows: (N, K) or (M,) those of each patch.
        offsets: (N + 1,) where those of each patch begin.
        inside: they are children of a patch or of its descendants.
    """

    part: Part
    rows: Integer[np.ndarray, " M"]
    offsets: Integer[np.ndarray, " N1"]
    inside: bool

    def bounds(self, frames: Float[np.ndarray, "N 6"], levels: Levels) -> Float[np.ndarray, "N 2"]:
        """Return the least and the largest height of each over its plane."""
        mesh, made = self.part.topology, np.empty((len(frames), 2))
        read = mesh.corners, mesh.corner_edges, mesh.half_edges, mesh.edge_class
        asked = self.offsets, self.rows, np.ascontiguousarray(frames), self.inside
        rest = *read, *_rules(self.part, levels), *asked
        levels.blocks.run(
            len(made),
            lambda begin, end: kernels.bound_patches(self.part.points, *rest, begin, end, made),
        )
        return made

    def later(self, some: Integer[np.ndarray, " K"], levels: Levels) -> Patches:
        """Return some of them a level later."""
        places, offsets = ragged(self.offsets, some)
        part, first = _split(self.part, self.rows[places], levels)
        return Patches(part, _children(first), CHILDREN * offsets, inside=True)


@dataclass(frozen=True, eq=False)
class Sides:
    """Sides of patches as corners that leave them, of quads of a part of a level.

    Attributes:
        part: the quads.
        rows: (N, K) the corners that the parts of each side leave.
    """

    part: Part
    rows: Integer[np.ndarray, "N K"]

    def bounds(self, frames: Float[np.ndarray, "N 9"], levels: Levels) -> Float[np.ndarray, " N"]:
        """Return how far each is from a line."""
        mesh, made = self.part.topology, np.empty(len(frames))
        rest = mesh.corners, mesh.corner_edges, *_rules(self.part, levels)
        asked = np.ascontiguousarray(self.rows), np.ascontiguousarray(frames)
        levels.blocks.run(
            len(made),
            lambda begin, end: kernels.bound_sides(
                self.part.points, *rest, *asked, begin, end, made
            ),
        )
        return made

    def later(self, some: Integer[np.ndarray, " K"], levels: Levels) -> Sides:
        """Return some of them a level later."""
        rows = self.rows[some]
        part, first = _split(self.part, rows // QUAD, levels)
        halves = [QUAD * (first + (rows + by) % QUAD) + side for by, side in HALVES]
        return Sides(part, np.stack(halves, axis=2).reshape(len(some), -1))


def near_enough(
    given: Patches | Sides,
    frames: Float[np.ndarray, "N K"],
    levels: Levels,
    enough: float,
    steps: int,
) -> Float[np.ndarray, " N *B"]:
    """Return bounds of patches or sides; those below ``enough`` need not be exact."""
    made = given.bounds(frames, levels)
    worst = np.abs(made).reshape(len(made), -1).max(axis=1, initial=0.0)
    asked = worst > enough
    if enough > 0:
        asked &= worst < FAR * enough
    asked = np.flatnonzero(asked if _lasts(given.part, levels) else np.zeros(0))
    for begin in range(0, len(asked) if steps else 0, TOGETHER):
        some = asked[begin : begin + TOGETHER]
        later = near_enough(given.later(some, levels), frames[some], levels, enough, steps - 1)
        if made.ndim > 1:
            made[some, 0] = np.maximum(made[some, 0], later[:, 0])
            made[some, 1] = np.minimum(made[some, 1], later[:, 1])
        else:
            made[some] = np.minimum(made[some], later)
    return made


def planes(
    points: Float[np.ndarray, "N M 3"], counts: Integer[np.ndarray, " N"]
) -> Float[np.ndarray, "N 6"]:
    """Return middles and normals of polygons; of fewer corners the first follows the last."""
    spare = (points.shape[1] - counts)[:, None]
    middles = (points.sum(axis=1) - spare * points[:, 0]) / counts[:, None]
    from_middle = points - middles[:, None]
    normals = np.zeros_like(middles)
    for k in range(points.shape[1]):
        normals += cross(from_middle[:, k - 1], from_middle[:, k])
    return np.column_stack([middles, unit(normals)])


def lines(
    begin: Float[np.ndarray, "N 3"],
    end: Float[np.ndarray, "N 3"],
    normals: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 9"]:
    """Return a point of lines, and two directions across them."""
    along = unit(end - begin)
    up = unit(normals - dot(normals, along)[:, None] * along)
    return np.column_stack([begin, up, cross(along, up)])


def _lasts(part: Part, levels: Levels) -> bool:
    """Return whether rules are known one level later."""
    mesh = part.topology
    wears = any((np.isfinite(of) & (of > 0)).any() for of in (mesh.wear, mesh.vertex_sharpness))
    return not wears or part.depth < levels.deepest


def _rules(part: Part, levels: Levels) -> tuple[np.ndarray, ...]:
    """Return sharpness that lasts, rules of vertices, neighbours on curves; corners at vertices."""
    mesh = part.topology
    if not levels.lasts(part.depth):
        mesh = mesh.without_creases()
    elif len(mesh.wear):
        fades = (mesh.wear > 0) & np.isfinite(mesh.wear)
        classes = np.where(fades, connectivity.INTERIOR, mesh.edge_class).astype(np.int8)
        soft = np.where(fades, 0.0, mesh.soft) if len(mesh.soft) else mesh.soft
        mesh = replace(mesh, edge_class=classes, soft=soft)
    # Corners read less. What they are sharp for may end.
    none = dict.fromkeys(("wear", "found", "vertex_sharpness", "soft_corners"), NO_WEIGHTS)
    mesh = replace(mesh, **none)
    count, sharp = mesh.vertex_count, mesh.sharpest
    rules, neighbours = np.zeros((count, 2)), np.zeros((count, 2), dtype=np.uint32)
    if sharp is not None:
        second, third = sharp.weights[:, 1], sharp.weights[:, 2]
        rules, neighbours = np.column_stack([second, second - third]), sharp.neighbours
    around = np.argsort(mesh.corners, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(mesh.corners, minlength=count))])
    return mesh.sharpness, rules, neighbours, around, starts


def _split(
    part: Part, rows: Integer[np.ndarray, "*M"], levels: Levels
) -> tuple[Part, Integer[np.ndarray, "*M"]]:
    """Return the part in which children of some quads exist, and the first child of each."""
    flags = marked(rows, part.topology.face_count)
    finer, _, _ = levels.split(part, flags, 0)
    return finer, np.flatnonzero(finer.exists)[::CHILDREN][(np.cumsum(flags) - 1)[rows]]


def _children(first: Integer[np.ndarray, " M"]) -> Integer[np.ndarray, " C"]:
    return (first[:, None] + np.arange(CHILDREN)).reshape(-1)
