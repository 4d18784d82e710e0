"""The learned rules of edge vertices, block by block: kernels around the network's call."""

from __future__ import annotations

import numpy as np

from pns_common.features.orientation import SYMMETRIC
from pns_common.formula.correction import where_open
from pns_common.formula.side_gate import gentle_bend, opened
from pns_common.fused.additions import Additions, Surroundings
from pns_common.fused.kernels.edge_correction import (
    DIHEDRAL,
    LENGTHS,
    correct,
    correct_scale_free,
    fill_log_ratios,
    look,
)
from pns_common.geometry.frames import EdgeFrames
from pns_common.rules.learned import LearnedEdgeRule
from pns_common.rules.scale_free import ScaleFreeEdgeRule

NO_FIELDS = np.zeros((0, 4))


def add_at_edges(
    rule: LearnedEdgeRule | ScaleFreeEdgeRule, level: Surroundings, to: Additions
) -> None:
    """What a rule adds at the interior edges; ``to`` has a row for each edge.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    mesh = level.mesh
    args = mesh.faces, mesh.edges, mesh.half_edges, mesh.interior
    out = to.displacement, to.ratio, to.gate, to.envelope
    # Before the blocks: what several threads ask for is computed once.
    normals = level.faces.normals
    fields = level.rings.fields if rule.operator.features.count > DIHEDRAL else NO_FIELDS
    bounds = level.boundary
    pushes = level.pushes if isinstance(rule, ScaleFreeEdgeRule) else NO_FIELDS
    reads_sides = isinstance(rule, ScaleFreeEdgeRule) and rule.form.side_gates
    bends = level.bends if reads_sides else None

    def add(rows: slice) -> None:
        count = rows.stop - rows.start
        frame, features = np.empty((count, 9)), np.empty((count, rule.operator.features.count))
        length, longest, curvature = np.empty(count), np.empty(count), np.empty(count)
        lengths = np.empty((LENGTHS, count))
        degenerate = np.empty(count, dtype=bool)
        symmetric = int(rule.operator.orientation is SYMMETRIC)
        looked = frame, length, longest, curvature, degenerate, lengths, features
        look(level.points, normals, fields, *args, rows.start, rows.stop, symmetric, *looked)
        # numpy's logarithm and hyperbolic tangent run on vectors, and have the array kernels' bits.
        fill_log_ratios(np.log(lengths), features)
        axes = frame[:, :3], frame[:, 3:6], frame[:, 6:]
        frames = EdgeFrames(*axes, length, curvature, degenerate)
        ends = mesh.edges[mesh.interior[rows]]
        gate = rule.operator.gate(frames)
        if bends is not None and isinstance(rule, ScaleFreeEdgeRule):
            beside = mesh.half_edges[mesh.interior[rows]] // 3
            of_both = bends[beside[:, 0]], bends[beside[:, 1]]
            gate = opened(gate, gentle_bend(*of_both, rule.vertex_gate_sharpness))
        answers = where_open(rule.operator.network, features, gate, like=axes[0])
        eta = np.ascontiguousarray(answers)
        to.degenerate[mesh.interior[rows]] = degenerate
        if isinstance(rule, LearnedEdgeRule):
            budget_per_length = level.budget_per_length(ends[:, 0], rule.budget)
            correct(eta, frame, length, gate, budget_per_length, mesh.interior, rows.start, *out)
        else:
            form = rule.form
            bounded = longest if form.wide_bound else length
            budget_per_length = level.budget_per_length(ends[:, 0], form.budget)
            answer = eta, frame, level.rings.network_lengths, bounded, gate, budget_per_length
            prior = (
                pushes,
                bounds.pushes,
                bounds.nothing,
                *args[:3],
                form.prior_strength,
                form.network_scale,
            )
            correct_scale_free(*answer, mesh.interior, rows.start, *prior, *out)

    level.network_blocks.run(len(mesh.interior), add)
