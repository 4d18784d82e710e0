"""Untrained controls: what anyone can have without a network. A learned rule has to beat them."""

import numpy as np

from pns_common import Scheme
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from pns_common.schemes.limit import limit_positions
from train.baselines.placement import midpoints, placed_edges, vertex_normals
from train.refining import additions


def flat() -> Scheme:
    """Return midpoint subdivision: the control mesh itself, with more faces."""
    return Scheme(
        "flat",
        rule=lambda level: placed_edges(level, midpoints(level), level.points),
        learned_levels=None,
    )


def n1() -> Scheme:
    """Return N1: each vertex pushed out once by what Loop's limit takes from it along its normal.

    With e = p − (Loop's limit position of p) and m the normal at p: Loop on p + (e · m) m.
    """
    return Scheme("n1", rule=_normal_push, learned_levels=1)


def _normal_push(level: Level) -> Additions:
    taken = level.points - limit_positions(level.points, level.topology, level.blocks, level.base)
    normals = vertex_normals(level)
    push = (taken * normals).sum(axis=1, keepdims=True) * normals
    pushed = level.base.place(push, level.topology, level.blocks)
    none = np.zeros(len(pushed))
    return additions(level, pushed, none, none)
