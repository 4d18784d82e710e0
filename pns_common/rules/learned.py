"""The rules of models of formats 1 and 2: equation 1 on edges, and its like at old vertices.

q  = q0 + h² γ F η(φ)                 ‖η‖ ≤ C / R
p' = p0 + h_v² γ_v (C / R) v          ‖v‖ ≤ 1
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pns_common.formula.correction import Correction
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.loop import loop_edge_rule, loop_vertex_rule
from pns_common.rules.placement import Placement, correct_in_blocks, with_correction


@dataclass(frozen=True)
class LearnedEdgeRule:
    """q = q0 + h² γ F η(φ) on interior edges, the midpoint on all others; ``budget`` is C."""

    operator: EdgeOperator
    budget: float

    def __call__(self, level: ControlLevel) -> Placement:
        """Place the vertices of a level."""
        base = loop_edge_rule(level)
        if level.reference_length == 0:
            return base
        fields, interior = self.operator.features.fields(level.rings), level.topology.interior

        def correct(rows: slice) -> Correction:
            stencil = self.operator.stencil(
                level.points, level.normals, fields, level.topology, interior[rows]
            )
            budget_per_length = level.budget_per_length(
                level.topology.edges[interior[rows], 0], self.budget
            )
            return self.operator.correct(stencil, budget_per_length)

        return with_correction(
            base, interior, correct_in_blocks(level.blocks, len(interior), correct)
        )


@dataclass(frozen=True)
class LearnedVertexRule:
    """p' = p0 + h_v² γ_v (C / R) v on closed rings, Loop's rule on all others; ``budget`` is C."""

    operator: VertexOperator
    budget: float

    def __call__(self, level: ControlLevel) -> Placement:
        """Place the vertices of a level."""
        base = loop_vertex_rule(level)
        if level.reference_length == 0:
            return base
        smooth = level.topology.smooth_vertices
        rows = np.flatnonzero(smooth)
        budget_per_length = level.budget_per_length(rows, self.budget)
        result = self.operator.correct(level.rings, rows, budget_per_length)
        return replace(with_correction(base, rows, result), corrected=smooth)
