"""The prior of curves by kernels: what rules/curves.py makes of a level's curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.formula.curve_prior import are_of, curve_gate
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.curve_moves import (
    move_edges,
    move_vertices,
    move_vertices_but_at_tips,
)
from pns_common.fused.kernels.curves import (
    follow_curves,
    measure_turns,
    push_curves,
    sum_pushes,
)
from pns_common.fused.kernels.edges import BOUNDARY, CREASE
from pns_common.fused.kernels.masks import blend_vertices
from pns_common.fused.learned.budgets import budgets_per_length
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.loop_points import owners
from pns_common.fused.levels.loop_weights import weights_of
from pns_common.fused.levels.mesh_edges import MeshEdges
from pns_common.rules.curves import CurveRule

# Neighbours along a curve.
TWO = 2


@dataclass(frozen=True, eq=False)
class CurveLevel:
    """A level with its curves, as ``curve_prior.Curves`` has them, in rows for all vertices.

    Attributes:
        points, mesh: the level.
        length: R, or each vertex's own.
        blocks: of whose work nobody is told.
        movable: the vertices on exactly two edges of curves, and on no other that is sharp.
        rows: their numbers.
        sides: of each of these its two neighbours along the curve; of others anything.
    """

    points: Float[np.ndarray, "V 3"]
    mesh: MeshEdges
    length: float | Float[np.ndarray, " V"]
    blocks: Blocks
    movable: Bool[np.ndarray, " V"]
    rows: Int[np.ndarray, " N"]
    sides: Int[np.ndarray, "V 2"]

    @classmethod
    def of(
        cls,
        points: Float[np.ndarray, "V 3"],
        mesh: MeshEdges,
        length: float | Float[np.ndarray, " V"],
        of_curve: Bool[np.ndarray, " E"],
        blocks: Blocks,
    ) -> CurveLevel:
        """Find the curves that some edges of a level make."""
        count, quiet = mesh.vertex_count, blocks.unheard()
        sides, met = np.empty((count, 2), dtype=np.int32), np.empty(count, dtype=np.int8)
        along = mesh.edges, mesh.sharp_edges, of_curve, mesh.sharp
        owners(quiet, count).run(count, follow_curves.over(*along, ROWS, sides, met))
        movable = met == TWO
        rows = np.flatnonzero(movable).astype(np.int32)
        return cls(points, mesh, length, quiet, movable, rows, sides)

    def pushes(self, rule: CurveRule) -> Float[np.ndarray, "V 3"]:
        """Return d of all vertices, as the rule has them."""
        pushes, strength = np.zeros(self.points.shape), rule.form.boundary_strength
        around = self.points, self.sides, self.rows

        def push(rows: slice) -> None:
            bounds, turns = (rows.start, rows.stop), np.empty(rows.stop - rows.start)
            measure_turns(*around, *bounds, turns)
            # numpy's hyperbolic tangent runs on vectors, and has the array kernels' bits.
            gates = curve_gate(turns, rule.gate_sharpness)
            push_curves(*around, gates, strength, *bounds, pushes)

        self.blocks.run(len(self.rows), push)
        return pushes


@dataclass(frozen=True, eq=False)
class CurveMoves:
    """What a rule makes of a level's curves.

    Attributes:
        rule, level: None where there is no rule, or no edge that a curve may be made of.
        pushes: of all vertices; (0, 3) where none is of a curve, and none moves.
        movable: vertices whose pushes may not be 0; (0,) likewise.
        nothing: what is added in place of pushes: 0, or −0 where there is no rule.
    """

    rule: CurveRule | None
    level: CurveLevel | None
    pushes: Float[np.ndarray, "P 3"]
    movable: Bool[np.ndarray, " P"]
    nothing: float

    def move_vertices(self, loop: Float[np.ndarray, "V 3"], added: Additions) -> None:
        """Add to curves' vertices, where nothing was; Loop puts the level's at ``loop``."""
        if self.rule is None or self.level is None or not len(self.pushes):
            return
        level, form = self.level, self.rule.form
        around = level.points, self.pushes, level.sides, level.rows
        to = added.displacement, added.ratio, added.envelope

        def move(rows: slice) -> None:
            budgets = budgets_per_length(form.budget, level.length, level.rows[rows])
            which = *around, budgets, rows.start, rows.stop
            if form.tip_strength:
                move_vertices_but_at_tips(*which, loop, form.tip_strength, *to)
            else:
                move_vertices(*which, *to)

        level.blocks.run(len(level.rows), move)
        if added.corrected is not None:
            np.logical_or(added.corrected, level.movable, out=added.corrected)

    def move_edges(self, added: Additions) -> None:
        """Add to curves' edges likewise."""
        if self.rule is None or self.level is None or not len(self.pushes):
            return
        level, budget, sharp_edges = self.level, self.rule.form.budget, self.level.mesh.sharp_edges
        around = level.points, self.pushes, level.movable, level.mesh.edges, sharp_edges
        to = added.displacement, added.ratio, added.envelope

        def move(rows: slice) -> None:
            first_ends = np.take(level.mesh.edges[:, 0], sharp_edges[rows])
            budgets = budgets_per_length(budget, level.length, first_ends)
            move_edges(*around, budgets, rows.start, rows.stop, *to)

        level.blocks.run(len(sharp_edges), move)

    def shared(self) -> Bool[np.ndarray, " W"] | None:
        """Return what the fold guard takes for shared with other pieces; None where nothing is.

        That is what boundaries alone place: vertices, then edges (``curve_prior.on_boundary``).
        """
        if self.level is None:
            return None
        mesh = self.level.mesh
        on_boundary = mesh.edge_class == BOUNDARY
        if not on_boundary.any():
            return None
        shared = np.concatenate([self.level.movable, on_boundary])
        creases = mesh.edges[np.flatnonzero(mesh.edge_class == CREASE)]
        shared[: mesh.vertex_count][creases] = False
        return shared


NO_PUSHES, NONE_MOVABLE = np.zeros((0, 3)), np.zeros(0, dtype=bool)
NO_RULE = CurveMoves(None, None, NO_PUSHES, NONE_MOVABLE, -0.0)


def curves_of(
    rule: CurveRule | None,
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    length: float | Float[np.ndarray, " V"],
    blocks: Blocks,
) -> CurveMoves:
    """Make what ``rule`` adds at a level's curves; ``length`` is R, or each vertex's own."""
    if rule is None:
        return NO_RULE
    of_curve = are_of(rule.kinds, mesh.edge_class)
    if not of_curve.any():
        return CurveMoves(rule, None, NO_PUSHES, NONE_MOVABLE, 0.0)
    level = CurveLevel.of(points, mesh, length, of_curve, blocks)
    if len(level.rows) == 0:
        return CurveMoves(rule, level, NO_PUSHES, NONE_MOVABLE, 0.0)
    return CurveMoves(rule, level, level.pushes(rule), level.movable, 0.0)


def placed_pushes(
    curves: CurveMoves, mesh: MeshEdges, valence: Int[np.ndarray, " V"], blocks: Blocks
) -> Float[np.ndarray, "P 3"]:
    """Return what Loop's vertex mask makes of curves' pushes; (0, 3) where there are none.

    At vertices beside curves: what stands at those on sharp edges is of no use.
    """
    pushes, movable, count = curves.pushes, curves.movable, mesh.vertex_count
    if not len(pushes):
        return pushes
    placed, beta = np.empty_like(pushes), weights_of(valence).beta
    add_up = sum_pushes.over(pushes, movable, mesh.edges, mesh.edge_reach, ROWS, placed)
    blend = blend_vertices.over(pushes, valence, mesh.sharp, beta, ROWS, placed)

    def rings(rows: slice) -> None:
        add_up(rows)
        blend(rows)

    owners(blocks.unheard(), count).run(count, rings)
    return placed
