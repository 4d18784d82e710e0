"""What the prior of curves adds to Loop's curve rule, at the vertices and edges of curves."""

from __future__ import annotations

from dataclasses import dataclass, replace

from jaxtyping import Float

from pns_common.base.arrays import Array, dot, gather, namespace, norm
from pns_common.formula.correction import Correction, shortened
from pns_common.formula.curve_prior import (
    BOUNDARIES,
    BOUNDARIES_AND_CREASES,
    Kinds,
    across,
    curve_direction,
    curve_mask,
)
from pns_common.formula.tips import CURVE_FURTHER, far_behind, kept_at_tips, left_behind
from pns_common.geometry.rings import root
from pns_common.masks.stencils import MIDPOINT
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.placement import Placement, with_more
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
        """Move curves' vertices too."""
        curves = level.curves(self.kinds)
        if len(curves.rows) == 0:
            return placed
        made = self.at_vertices(level, gather(placed.loop, curves.rows))
        corrected = placed.corrected
        corrected = curves.movable if corrected is None else corrected | curves.movable
        return replace(with_more(placed, curves.rows, made), corrected=corrected)

    def move_edges(self, level: ControlLevel, placed: Placement) -> Placement:
        """Move curves' edges too."""
        curves = level.curves(self.kinds)
        if len(curves.rows) == 0:
            return placed
        return with_more(placed, curves.edges, self.at_edges(level))

    def at_vertices(self, level: ControlLevel, loop: Float[Array, "N 3"]) -> Correction:
        """Return what is added to the curves' vertices, which Loop puts at ``loop``.

        Loop's curve mask of the pushes, or Loop's own move taken back at tips, within ρ.
        """
        curves, pushes = level.curves(self.kinds), self.pushes(level)
        rows, a, b = curves.rows, curves.a, curves.b
        wanted = curve_mask(curves, pushes)
        square = (dot(a, a) + dot(b, b)) / 2
        if self.form.tip_strength:
            moved = loop - gather(level.points, rows)
            behind = left_behind(gather(pushes, rows), wanted, moved, CURVE_FURTHER)
            left = norm(across(behind, curve_direction(a, b)))[:, None]
            tip = far_behind(left, root(square[:, None]))
            wanted = kept_at_tips(wanted, moved, tip, self.form.tip_strength)
        return _within(wanted, level.budget_per_length(rows, self.form.budget) * square)

    def at_edges(self, level: ControlLevel) -> Correction:
        """Return what is added to the curves' edges: the mean of the pushes at their ends, in ρ."""
        ends, pushes = level.topology.edges[level.curves(self.kinds).edges], self.pushes(level)
        wanted = MIDPOINT * (gather(pushes, ends[:, 0]) + gather(pushes, ends[:, 1]))
        edge = gather(level.points, ends[:, 1]) - gather(level.points, ends[:, 0])
        budget_per_length = level.budget_per_length(ends[:, 0], self.form.budget)
        return _within(wanted, budget_per_length * dot(edge, edge))


def _within(wanted: Float[Array, "N 3"], envelope: Float[Array, " N"]) -> Correction:
    """Return Π_ρ of what is wanted, ρ given; curves have no gate."""
    xp = namespace(wanted)
    nothing = xp.zeros_like(envelope)
    degenerate = xp.zeros_like(nothing, dtype=xp.bool)
    return Correction(shortened(wanted, envelope), envelope, nothing, degenerate)
