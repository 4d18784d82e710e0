"""The learned rules of edge vertices, block by block: kernels around the network's call."""

from __future__ import annotations

import numpy as np

from pns_common.features.orientation import SYMMETRIC
from pns_common.formula.correction import where_open
from pns_common.formula.side_gate import of_gentler, opened_where_shut
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.edge_correction import correct, correct_scale_free
from pns_common.fused.kernels.edge_features import DIHEDRAL, HELD, look
from pns_common.fused.kernels.together import TOGETHER
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.additions import Additions
from pns_common.rules.learned import LearnedEdgeRule
from pns_common.rules.scale_free import ScaleFreeEdgeRule

NO_FIELDS, NO_BENDS = np.zeros((0, 4)), np.zeros(0)


def add_at_edges(
    rule: LearnedEdgeRule | ScaleFreeEdgeRule, level: Surroundings, to: Additions
) -> None:
    """Add what a rule wants at the interior edges; ``to`` has a row for each edge.

    At the others it adds nothing.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    mesh, width = level.mesh, rule.operator.features.count
    to.clear_rows(mesh.sharp_edges, level.blocks)
    connectivity = mesh.faces, mesh.edges, mesh.face_edges, mesh.half_edges, mesh.interior
    out = to.displacement, to.ratio, to.gate, to.envelope
    # Before the blocks: what several threads ask for is computed once.
    normals = level.faces.normals
    fields = level.rings.fields if width > DIHEDRAL else NO_FIELDS
    reads_sides = isinstance(rule, ScaleFreeEdgeRule) and rule.form.side_gates
    bends = level.bends if reads_sides else NO_BENDS
    measures = level.points, normals, fields, bends, level.edges.lengths, level.logs
    read = [each.reshape(-1) for each in (*measures, *connectivity)]
    look_at = look.over(*read, ROWS, int(rule.operator.orientation == SYMMETRIC))
    if isinstance(rule, LearnedEdgeRule):
        write = correct.over(mesh.interior, ROWS, *out)
    else:
        curves, scale = level.curves, rule.form.network_scale
        wanted = level.edges.network_lengths, level.pushes, curves.pushes, curves.nothing, scale
        write = correct_scale_free.over(*wanted, mesh.interior, ROWS, *out)

    def add(rows: slice) -> None:
        count = rows.stop - rows.start
        frame, features = np.empty((count, 9)), np.empty((count, width))
        length, longest, curvature = np.empty(count), np.empty(count), np.empty(count)
        stencils, degenerate = np.empty((count, 4), dtype=np.int32), np.empty(count, dtype=bool)
        gentlest = np.empty(count if reads_sides else 0)
        rest = length, longest, curvature, degenerate, features, gentlest
        looked = stencils.reshape(-1), frame.reshape(-1), *rest, np.zeros(HELD * TOGETHER)
        look_at(rows, *looked)
        # numpy's hyperbolic tangent runs on vectors, and has the array kernels' bits.
        if isinstance(rule, ScaleFreeEdgeRule) and rule.form.side_gates:
            by = of_gentler(gentlest, rule.vertex_gate_sharpness)
            by[degenerate] = 0.0
            gate = opened_where_shut(rule.operator.gate, curvature, by)
        else:
            gate = rule.operator.gate(curvature)
        if degenerate.any():
            to.degenerate[mesh.interior[rows]] = degenerate
        answers = where_open(rule.operator.network, features, gate, like=frame[:, :3])
        answer = np.ascontiguousarray(answers), frame
        if isinstance(rule, LearnedEdgeRule):
            budget_per_length = level.budget_per_length(stencils[:, 0], rule.budget)
            write(rows, *answer, length, gate, budget_per_length)
        else:
            bounded = longest if rule.form.wide_bound else length
            budget_per_length = level.budget_per_length(stencils[:, 0], rule.form.budget)
            strengths = level.prior_strengths(stencils[:, 0])
            write(rows, *answer, bounded, gate, budget_per_length, stencils, strengths)

    level.network_blocks.run(len(mesh.interior), add)
