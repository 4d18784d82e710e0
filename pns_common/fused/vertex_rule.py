"""The learned rules of old vertices, block by block: kernels around the network's call."""

from __future__ import annotations

import numpy as np

from pns_common.formula.correction import where_open
from pns_common.formula.gate import gate_of
from pns_common.fused.additions import Additions
from pns_common.fused.kernels.vertex_correction import correct, correct_scale_free, look_around
from pns_common.fused.surroundings import Surroundings
from pns_common.fused.vertex_prior import priors_at
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
    to.clear_rows(np.flatnonzero(~rings.smooth).astype(np.int32), level.blocks)
    out = to.displacement, to.ratio, to.gate, to.envelope
    prior = np.empty((0, 3))
    if isinstance(rule, ScaleFreeVertexRule):
        prior = priors_at(vertices, rule.form, level)

    def add(rows: slice) -> None:
        count = rows.stop - rows.start
        features, mean_jump = np.empty((count, operator.features.count)), np.empty(count)
        around = rings.means, rings.fields
        look_around(*around, vertices, rows.start, rows.stop, features, mean_jump)
        gate = gate_of(operator.gate_sharpness * mean_jump)
        like = np.empty((count, 3))
        z = np.ascontiguousarray(where_open(operator.network, features, gate, like))
        if isinstance(rule, LearnedVertexRule):
            budget_per_length = level.budget_per_length(vertices[rows], rule.budget)
            correct(z, gate, *around, budget_per_length, vertices, rows.start, *out)
        else:
            form = rule.form
            budget_per_length = level.budget_per_length(vertices[rows], form.budget)
            answer = z, gate, *around, budget_per_length, vertices, rows.start
            correct_scale_free(*answer, prior, level.curves.nothing, form.network_scale, *out)

    level.network_blocks.run(len(vertices), add)
