"""A learned level: Loop's vertices, what both rules add, the fold guard, and the report."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.fused.learned.added_by_rules import added_by_rules, curve_rule
from pns_common.fused.learned.curves import curves_of
from pns_common.fused.learned.guard import guard_scale
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.child_faces import look_at_children
from pns_common.fused.levels.level import FusedLevel, FusedStep, crease_shift_of
from pns_common.fused.levels.loop_points import add_to, loop_points
from pns_common.levels.diagnostics import LevelReport, Reach, bound_of, level_report
from pns_common.levels.step import AddedStep
from pns_common.schemes import Scheme

# Far above rounding, and the cosine of more than any useful fold angle.
CLEAR_COSINE = 1e-9


@dataclass(frozen=True, eq=False)
class LearnedPoints:
    """What a learned level made, before anybody looks at its children.

    ``largest`` is the largest absolute coordinate, NaN where one is; ``longest`` the longest δ.
    ``counterpart`` is where Loop would have put the points; None where no child can be flipped.
    ``added`` is what was added at ``vertices`` and ``edges`` together, ``guard`` the guard's s.
    """

    points: Float[np.ndarray, "W 3"]
    largest: float
    longest: float
    counterpart: Float[np.ndarray, "W 3"] | None
    vertices: Additions
    edges: Additions
    added: Additions
    guard: Float[np.ndarray, " W"] | None

    @property
    def step(self) -> AddedStep:
        """What was added, as reports have it."""
        return AddedStep(self.vertices, self.edges, learned=True, guard=self.guard)


def learned_step(level: FusedLevel, scheme: Scheme, length: float, blocks: Blocks) -> FusedStep:
    """Place a level's vertices by the scheme's own rules; ``length`` is R > 0.

    The kernels must know the scheme (known.py).

    Raises:
        ModelError: a network returned something that is not finite, or of another shape.
    """
    made = learned_points(level, scheme, length, blocks)
    mesh, shift_of = level.mesh, crease_shift_of(level)
    points, counterpart, added = made.points, made.counterpart, made.added.forgotten()
    reach = Reach(made.longest, bound_of(made.step))
    # This is kept until the report is asked for.
    rules = made.vertices.forgotten(), made.edges.forgotten()
    step = AddedStep(*rules, learned=True, guard=made.guard)

    def report() -> LevelReport:
        children = look_at_children(mesh, points, counterpart, blocks.unheard())
        shift = shift_of(points)
        largest_shift = None if shift is None else shift.largest
        return level_report(mesh, step, children, largest_shift, reach)

    return FusedStep(points, made.largest, report, added)


def learned_points(
    level: FusedLevel,
    scheme: Scheme,
    length: float | Float[np.ndarray, " V"],
    blocks: Blocks,
    strength: float | Float[np.ndarray, " V"] | None = None,
) -> LearnedPoints:
    """Return the same, without a look at the children.

    ``length`` may be each vertex's own, and so may ``strength``, s; None: it is the scheme's.

    Raises:
        ModelError: a network returned something that is not finite, or of another shape.
    """
    mesh, count = level.mesh, level.mesh.vertex_count
    curves = curves_of(curve_rule(scheme), level.points, mesh, length, blocks)
    made = added_by_rules(level, scheme, length, blocks, curves, strength)
    vertices, edges, added = made.vertices, made.edges, made.both
    # Not before: what the rules read has the most memory.
    loop = loop_points(level.points, mesh, blocks)
    curves.move_vertices(loop[:count], vertices)
    curves.move_edges(edges)
    scale = None
    if scheme.guard is not None:
        shared = curves.shared()
        moved = made.moved_with(curves)
        scale = guard_scale(scheme.guard, mesh, loop, added.displacement, blocks, shared, moved)
        if scale is None:
            scale = np.broadcast_to(1.0, len(loop))
        else:
            added.scale(scale)

    # What the guard lets stand is at clearly less than a right angle to Loop's: none is flipped.
    guarded = scheme.guard is not None and math.cos(scheme.guard.angle) > CLEAR_COSINE
    points = loop if guarded else loop.copy()
    first = count if vertices.corrected is None else 0
    largest, longest = add_to(points, added.displacement, first, blocks)
    counterpart = None if guarded else loop
    return LearnedPoints(points, largest, longest, counterpart, vertices, edges, added, scale)
