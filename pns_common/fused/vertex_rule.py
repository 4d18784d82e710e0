"""The learned rules of old vertices, block by block: kernels around the network's call."""

from __future__ import annotations

import numpy as np

from pns_common.formula.correction import where_open
from pns_common.fused.additions import Additions
from pns_common.fused.kernels.vertex_correction import correct, correct_scale_free, look_around
from pns_common.fused.loop_points import place_vertices
from pns_common.fused.surroundings import Surroundings
from pns_common.rules.learned import LearnedVertexRule
from pns_common.rules.scale_free import ScaleFreeVertexRule


def add_at_vertices(
    rule: LearnedVertexRule | ScaleFreeVertexRule, level: Surroundings, to: Additions
) -> None:
    """Add what a rule wants at vertices with one closed ring; ``to`` has rows for old vertices.

    At the others it adds nothing.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    rings, operator = level.rings, rule.operator
    vertices = np.flatnonzero(rings.smooth).astype(np.int32)
    to.clear(np.flatnonzero(~rings.smooth))
    out = to.displacement, to.ratio, to.gate, to.envelope
    pushes = np.empty((0, 3))
    of_boundary = level.boundary.pushes, level.boundary.nothing
    if isinstance(rule, ScaleFreeVertexRule):
        pushes = np.empty_like(level.pushes)
        place_vertices(level.pushes, level.mesh, level.blocks, pushes)
        if len(level.boundary.pushes):
            placed = np.empty_like(pushes)
            place_vertices(level.boundary.pushes, level.mesh, level.blocks, placed)
            of_boundary = placed, 0.0

    def add(rows: slice) -> None:
        count = rows.stop - rows.start
        features, mean_jump = np.empty((count, operator.features.count)), np.empty(count)
        around = rings.means, rings.fields
        look_around(*around, vertices, rows.start, rows.stop, features, mean_jump)
        gate = np.tanh(operator.gate_sharpness * mean_jump)
        like = np.empty((count, 3))
        z = np.ascontiguousarray(where_open(operator.network, features, gate, like))
        if isinstance(rule, LearnedVertexRule):
            budget_per_length = level.budget_per_length(vertices[rows], rule.budget)
            correct(z, gate, *around, budget_per_length, vertices, rows.start, *out)
        else:
            form = rule.form
            budget_per_length = level.budget_per_length(vertices[rows], form.budget)
            answer = z, gate, *around, budget_per_length, vertices, rows.start
            correct_scale_free(
                *answer, pushes, *of_boundary, form.prior_strength, form.network_scale, *out
            )

    level.network_blocks.run(len(vertices), add)
