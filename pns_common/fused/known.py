"""Which schemes have compiled kernels: asked before these are loaded."""

from __future__ import annotations

from pns_common.features.edge_features import paper_features, signed_features, tilt_features
from pns_common.features.orientation import FIRST_FACE, SYMMETRIC
from pns_common.features.ring_features import RING_10
from pns_common.rules.curves import CurveRule
from pns_common.rules.learned import LearnedEdgeRule, LearnedVertexRule
from pns_common.rules.loop import loop_vertex_rule
from pns_common.rules.scale_free import ScaleFreeEdgeRule, ScaleFreeVertexRule
from pns_common.schemes import Rule, Scheme

# The kernels write these columns in this order, and know of no others.
FEATURES = (paper_features, tilt_features, signed_features)


def kernels_know(scheme: Scheme) -> bool:
    """Return whether the kernels have the features and the form of a scheme's own rules."""
    edges, vertices = scheme.edge_rule, scheme.vertex_rule
    if not isinstance(edges, LearnedEdgeRule | ScaleFreeEdgeRule):
        return False
    if _curves(edges) != _curves(vertices):
        return False
    if isinstance(vertices, LearnedVertexRule | ScaleFreeVertexRule):
        # Equal, not the same: a scheme that was copied or sent to another process has its own.
        if vertices.operator.features != RING_10:
            return False
    elif vertices is not loop_vertex_rule:
        return False
    operator = edges.operator
    return operator.features in FEATURES and operator.orientation in (FIRST_FACE, SYMMETRIC)


def _curves(rule: Rule) -> CurveRule | None:
    return rule.curves if isinstance(rule, ScaleFreeEdgeRule | ScaleFreeVertexRule) else None
