"""The rules of models of format 3: a fixed prior and a network that speaks in units of h.

    q  = q0 + γ   Π_ρ(D_e + τ ℓ_e F z(φ))          ‖z‖ ≤ 1, ρ = C h² / R
    p' = p0 + γ_v Π_ρ(D_v + τ ℓ_v Σ z_i e_i)       h_v the root mean square of the spokes

ℓ is h, but shorter beside thin faces (geometry/thin_faces.py), where the form says so.
They act at the first K levels, are followed by the fold guard, and Loop takes over after them.
Where the form has a boundary strength, boundary vertices and edges get Π_ρ of a prior of their own,
made of the boundary alone, and creases too if it says so; where it has none they are Loop's. Where
it has a tip strength, D_v gives way to Loop's own move, taken back, at tips (formula/tips.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, beside, dot, gather, namespace
from pns_common.connectivity.topology import Topology
from pns_common.formula.correction import Correction, FrameGate, by_curvature
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.prior import clear_normals
from pns_common.formula.side_gate import face_bends, gentle_bend, opened_gate
from pns_common.formula.tips import (
    bends_most,
    far_behind,
    kept_at_tips,
    left_behind,
    ring_further,
)
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.masks.stencils import loop_edge_point, loop_ring_weight, loop_vertex_vertices
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.curves import CurveRule
from pns_common.rules.loop import loop_edge_rule, loop_vertex_rule
from pns_common.rules.placement import Placement, correct_in_blocks, with_correction
from pns_common.rules.scale_free_form import ScaleFreeForm


@dataclass(frozen=True)
class ScaleFreeEdgeRule:
    """The rule for edge vertices, before the fold guard: midpoints stay where Loop has them.

    ``vertex_gate_sharpness`` is c_v, for gates that read the sides of an edge's faces.
    """

    operator: EdgeOperator
    form: ScaleFreeForm
    curves: CurveRule | None = None
    vertex_gate_sharpness: float = 1.0

    def __call__(self, level: ControlLevel) -> Placement:
        """Place the vertices of a level."""
        base = loop_edge_rule(level)
        if level.reference_length == 0:
            return base
        topology, interior = level.topology, level.topology.interior
        fields = self.operator.features.fields(level.rings)
        pushes, strength = level.pushes, self.form.prior_strength
        of_curves = None if self.curves is None else self.curves.pushes(level)
        lengths = level.network_lengths(self.form.network_altitudes).at_edges
        bends = None
        if self.form.side_gates:
            bends = face_bends(level.rings.edge_jumps, topology)

        def correct(rows: slice) -> Correction:
            edges = interior[rows]
            stencil = self.operator.stencil(level.points, level.normals, fields, topology, edges)
            prior = strength * _at_edges(pushes, topology, edges)
            if of_curves is not None:
                prior = prior + _at_edges(of_curves, topology, edges)
            budget_per_length = level.budget_per_length(topology.edges[edges, 0], self.form.budget)
            asked = self.form.network_scale * gather(lengths, edges)
            gate, wide = self._gate(bends, topology, edges), self.form.wide_bound
            return self.operator.correct_scale_free(
                stencil, budget_per_length, asked, prior, gate, wide
            )

        made = correct_in_blocks(level.blocks, len(interior), correct)
        placed = with_correction(base, interior, made)
        return placed if self.curves is None else self.curves.move_edges(level, placed)

    def _gate(
        self, bends: Float[Array, " F"] | None, topology: Topology, edges: Int[np.ndarray, " N"]
    ) -> FrameGate:
        """Return the gate of the two faces, opened by b of all faces where the form has them."""
        if bends is None:
            return by_curvature(self.operator.gate)
        faces = topology.edge_faces[edges]
        of_both = gather(bends, faces[:, 0]), gather(bends, faces[:, 1])
        return opened_gate(self.operator.gate, gentle_bend(*of_both, self.vertex_gate_sharpness))


@dataclass(frozen=True)
class ScaleFreeVertexRule:
    """The rule for old vertices, before the fold guard: those without a closed ring stay Loop's."""

    operator: VertexOperator
    form: ScaleFreeForm
    curves: CurveRule | None = None

    def __call__(self, level: ControlLevel) -> Placement:
        """Place the vertices of a level."""
        base = loop_vertex_rule(level)
        if level.reference_length == 0:
            return base
        ringed = level.topology.ringed_vertices
        rows = np.flatnonzero(ringed)
        pushes = gather(loop_vertex_vertices(level.pushes, level.topology), rows)
        prior = self.form.prior_strength * pushes
        if self.curves is not None:
            of_curves = loop_vertex_vertices(self.curves.pushes(level), level.topology)
            prior = prior + gather(of_curves, rows)
        if self.form.tip_strength:
            prior = self._kept_at_tips(level, rows, pushes, prior)
        budget_per_length = level.budget_per_length(rows, self.form.budget)
        lengths = level.network_lengths(self.form.network_altitudes).at_vertices
        asked = self.form.network_scale * gather(lengths, rows)
        made = self.operator.correct_scale_free(level.rings, rows, budget_per_length, asked, prior)
        placed = replace(with_correction(base, rows, made), corrected=ringed)
        return placed if self.curves is None else self.curves.move_vertices(level, placed)

    def _kept_at_tips(
        self,
        level: ControlLevel,
        rows: Int[np.ndarray, " N"],
        pushed: Float[Array, "N 3"],
        prior: Float[Array, "N 3"],
    ) -> Float[Array, "N 3"]:
        """Return D' of some rows from Loop's mask of their pushes, and D."""
        xp, rings, valence = namespace(prior), level.rings, level.topology.valence[rows]
        weights = loop_ring_weight(valence), ring_further(valence)
        step, further = (beside(prior, weight, prior.dtype)[:, None] for weight in weights)
        moved = step * gather(rings.umbrella, rows)
        behind = left_behind(gather(level.pushes, rows), pushed, moved, further)
        left = xp.abs(dot(behind, clear_normals(gather(rings.normal, rows))))[:, None]
        bends = (gather(bend, rows) for bend in (rings.mean_jump, rings.near_jump))
        tip = far_behind(left, gather(rings.spoke_length, rows)) * bends_most(*bends)
        return kept_at_tips(prior, moved, tip, self.form.tip_strength)


def _at_edges(
    pushes: Float[Array, "V 3"], topology: Topology, edges: Int[np.ndarray, " N"]
) -> Float[Array, "N 3"]:
    """Return what Loop's mask makes of pushes on interior edges."""
    return loop_edge_point(*(gather(pushes, topology.stencil[edges, k]) for k in range(4)))
