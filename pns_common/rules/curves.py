"""What the prior of curves adds to Loop's curve rule, at the vertices and edges of curves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, dot, gather, namespace, norm, scatter
from pns_common.formula.correction import Correction, proximity_ratio, shortened
from pns_common.formula.curve_prior import (
    BOUNDARIES,
    BOUNDARIES_AND_CREASES,
    Kinds,
    across,
    curve_direction,
)
from pns_common.formula.tips import CURVE_FURTHER, far_behind, kept_at_tips, left_behind
from pns_common.geometry.rings import root
from pns_common.masks.stencils import MIDPOINT, loop_vertex_vertices
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.placement import Placement
from pns_common.rules.scale_free_form import ScaleFreeForm


@dataclass(frozen=True)
class CurveRule:
    """What the prior adds at boundaries, and at creases with ``crease_prior``.

    ``gate_sharpness`` is c_v.
    """

    form: ScaleFreeForm
    gate_sharpness: float

    @property
    def kinds(self) -> Kinds:
        """The edges of its curves."""
        return BOUNDARIES_AND_CREASES if self.form.crease_prior else BOUNDARIES

    def pushes(self, level: ControlLevel) -> Float[Array, "V 3"]:
        """Return d of the curves' vertices, 0 elsewhere."""
        return self.form.boundary_strength * level.curve_pushes(self.gate_sharpness, self.kinds)

    def move_vertices(self, level: ControlLevel, placed: Placement) -> Placement:
        """Move curves' vertices too: Loop's curve mask of the pushes, within ρ; less at tips."""
        curves = level.curves(self.kinds)
        rows, a, b = curves.rows, curves.a, curves.b
        if len(rows) == 0:
            return placed
        pushes = self.pushes(level)
        wanted = gather(loop_vertex_vertices(pushes, level.topology), rows)
        square = (dot(a, a) + dot(b, b)) / 2
        if self.form.tip_strength:
            moved = gather(placed.loop, rows) - gather(level.points, rows)
            behind = left_behind(gather(pushes, rows), wanted, moved, CURVE_FURTHER)
            left = norm(across(behind, curve_direction(a, b)))[:, None]
            tip = far_behind(left, root(square[:, None]))
            wanted = kept_at_tips(wanted, moved, tip, self.form.tip_strength)
        budget_per_length = level.budget_per_length(rows, self.form.budget)
        changed = self._within(placed, rows, wanted, budget_per_length * square)
        corrected = placed.corrected
        corrected = curves.movable if corrected is None else corrected | curves.movable
        return replace(changed, corrected=corrected)

    def move_edges(self, level: ControlLevel, placed: Placement) -> Placement:
        """Move curves' edges too: the mean of the pushes at their ends, within ρ."""
        curves = level.curves(self.kinds)
        if len(curves.rows) == 0:
            return placed
        ends, pushes = level.topology.edges[curves.edges], self.pushes(level)
        wanted = MIDPOINT * (gather(pushes, ends[:, 0]) + gather(pushes, ends[:, 1]))
        edge = gather(level.points, ends[:, 1]) - gather(level.points, ends[:, 0])
        budget_per_length = level.budget_per_length(ends[:, 0], self.form.budget)
        return self._within(placed, curves.edges, wanted, budget_per_length * dot(edge, edge))

    def _within(
        self,
        placed: Placement,
        rows: Int[np.ndarray, " N"],
        wanted: Float[Array, "N 3"],
        envelope: Float[Array, " N"],
    ) -> Placement:
        """Add Π_ρ of what is wanted at rows where the placement had nothing; ρ is given."""
        xp, count = namespace(wanted), placed.loop.shape[0]
        moved = shortened(wanted, envelope)
        nothing = xp.zeros_like(envelope)
        made = Correction(moved, envelope, nothing, xp.zeros_like(nothing, dtype=xp.bool))
        displacement, bound = placed.displacement, placed.envelope
        assert displacement is not None  # a scale-free rule has placed them
        assert bound is not None
        return replace(
            placed,
            displacement=displacement + scatter(moved, rows, count),
            ratio=placed.ratio + scatter(proximity_ratio(made), rows, count),
            envelope=bound + scatter(envelope, rows, count),
        )
