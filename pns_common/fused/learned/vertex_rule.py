"""The learned rules of old vertices, block by block: kernels around the network's call."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pns_common.formula.correction import where_open
from pns_common.formula.gate import gate_of
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.vertex_correction import correct, correct_scale_free, look_around
from pns_common.fused.learned.rings import RingMeasures
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.learned.vertex_prior import priors_at
from pns_common.fused.levels.additions import Additions
from pns_common.rules.learned import LearnedVertexRule
from pns_common.rules.scale_free import ScaleFreeVertexRule


def rule_vertices(
    rule: LearnedVertexRule | ScaleFreeVertexRule, rings: RingMeasures
) -> Bool[np.ndarray, " V"]:
    """Return the vertices that a rule may move: darts by the scale-free one alone."""
    return rings.smooth if isinstance(rule, LearnedVertexRule) else rings.ringed


def add_at_vertices(
    rule: LearnedVertexRule | ScaleFreeVertexRule, level: Surroundings, to: Additions
) -> None:
    """Add what a rule wants at its vertices with a closed ring; ``to`` has rows for old ones.

    At the others it adds nothing.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    rings, operator = level.rings, rule.operator
    may_move = rule_vertices(rule, rings)
    vertices = np.flatnonzero(may_move).astype(np.int32)
    to.clear_rows(np.flatnonzero(~may_move).astype(np.int32), level.blocks)
    around, out = (rings.means, rings.fields), (to.displacement, to.ratio, to.gate, to.envelope)
    look = look_around.over(*around, vertices, ROWS)
    if isinstance(rule, LearnedVertexRule):
        budget = rule.budget
        write = correct.over(*around, vertices, ROWS, *out)
    else:
        form, budget = rule.form, rule.form.budget
        added = priors_at(vertices, form, level), level.curves.nothing, form.network_scale
        write = correct_scale_free.over(*around, *added, vertices, ROWS, *out)

    def add(rows: slice) -> None:
        count = rows.stop - rows.start
        features, mean_jump = np.empty((count, operator.features.count)), np.empty(count)
        look(rows, features, mean_jump)
        gate = gate_of(operator.gate_sharpness * mean_jump)
        like = np.empty((count, 3))
        z = np.ascontiguousarray(where_open(operator.network, features, gate, like))
        write(rows, z, gate, level.budget_per_length(vertices[rows], budget))

    level.network_blocks.run(len(vertices), add)
