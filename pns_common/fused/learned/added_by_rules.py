"""What a level's learned rules add to Loop's vertices, but on curves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.learned.bent_part import BentPart, bent_part
from pns_common.fused.learned.curves import CurveMoves
from pns_common.fused.learned.edge_rule import add_at_edges
from pns_common.fused.learned.guard import EVERYWHERE
from pns_common.fused.learned.rings import ringed_vertices
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.learned.vertex_rule import add_at_vertices, rule_vertices
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.level import FusedLevel
from pns_common.rules.curves import CurveRule
from pns_common.rules.learned import LearnedEdgeRule, LearnedVertexRule
from pns_common.rules.scale_free import ScaleFreeEdgeRule, ScaleFreeVertexRule
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class AddedByRules:
    """What both rules add but on curves: to vertices, to edges, and both together.

    ``moved`` marks the vertices, then edges, that get something; empty where that is not known.
    """

    vertices: Additions
    edges: Additions
    both: Additions
    moved: Bool[np.ndarray, " M"]

    @classmethod
    def unwritten(cls, vertex_count: int, edge_count: int) -> AddedByRules:
        """Make room for what is to be written, or cleared, in every row."""
        both = Additions.unwritten(vertex_count + edge_count)
        vertices, edges = both.rows(slice(0, vertex_count)), both.rows(slice(vertex_count, None))
        return cls(vertices, edges, both, EVERYWHERE)

    def moved_with(self, curves: CurveMoves) -> Bool[np.ndarray, " M"]:
        """Return ``moved`` with the vertices of curves, and all edges that may be of one."""
        if len(self.moved) == 0 or curves.level is None:
            return self.moved
        is_sharp = curves.level.mesh.edge_class != INTERIOR
        return self.moved | np.concatenate([curves.level.movable, is_sharp])


def added_by_rules(
    level: FusedLevel,
    scheme: Scheme,
    length: float | Float[np.ndarray, " V"],
    blocks: Blocks,
    curves: CurveMoves,
    strength: float | Float[np.ndarray, " V"] | None = None,
) -> AddedByRules:
    """Evaluate a level's rules: where it bends alone, if that is less of it.

    ``strength`` is s of the prior, of each vertex where parts have their own; None: the scheme's.

    Raises:
        ModelError: a network returned something that is not finite, or of another shape.
    """
    of_level = level.points, level.mesh, level.faces, level.multi_fan_vertices
    of_scheme = _altitudes(scheme), _prior_strength(scheme) if strength is None else strength
    whole = Surroundings(*of_level, length, blocks, curves, *of_scheme)
    part = bent_part(whole) if _adds_nothing_in_planes(scheme) else None
    return _evaluated(scheme, whole) if part is None else _evaluated_on(part, scheme, whole)


def _evaluated_on(part: BentPart, scheme: Scheme, whole: Surroundings) -> AddedByRules:
    """Evaluate the rules on a part: elsewhere they add nothing."""
    whole.faces.forget()
    made = AddedByRules.unwritten(0, 0) if part.seen is None else _evaluated(scheme, part.seen)
    to = AddedByRules.unwritten(whole.mesh.vertex_count, len(whole.mesh.edges))
    quiet = whole.blocks.unheard()
    of_vertices = part.vertices.spread(made.vertices, to.vertices, quiet)
    of_edges = part.edges.spread(made.edges, to.edges, quiet)
    ringed = ringed_vertices(whole.mesh, whole.multi_fan_vertices, quiet)
    vertices = replace(to.vertices, corrected=ringed)
    return replace(to, vertices=vertices, moved=np.concatenate([of_vertices, of_edges]))


def _evaluated(scheme: Scheme, seen: Surroundings) -> AddedByRules:
    """Evaluate the rules at all vertices and edges of a mesh."""
    edge_rule, vertex_rule = scheme.edge_rule, scheme.vertex_rule
    assert isinstance(edge_rule, LearnedEdgeRule | ScaleFreeEdgeRule)
    made = AddedByRules.unwritten(seen.mesh.vertex_count, len(seen.mesh.edges))
    vertices = made.vertices
    if isinstance(vertex_rule, LearnedVertexRule | ScaleFreeVertexRule):
        # A copy: the rule of curves moves more vertices.
        vertices = replace(vertices, corrected=rule_vertices(vertex_rule, seen.rings).copy())
        add_at_vertices(vertex_rule, seen, vertices)
        seen.forget_rings()
    else:
        vertices.clear()
    add_at_edges(edge_rule, seen, made.edges)
    seen.faces.forget()
    return replace(made, vertices=vertices)


def _adds_nothing_in_planes(scheme: Scheme) -> bool:
    """Return whether what the rules add where their gates are shut is 0, and not −0."""
    return curve_rule(scheme) is not None


def curve_rule(scheme: Scheme) -> CurveRule | None:
    """Return what a scheme adds at curves."""
    rule = scheme.edge_rule
    return rule.curves if isinstance(rule, ScaleFreeEdgeRule) else None


def _altitudes(scheme: Scheme) -> float:
    """Return α of the network's lengths; infinite where they are h."""
    rule = scheme.edge_rule
    altitudes = rule.form.network_altitudes if isinstance(rule, ScaleFreeEdgeRule) else None
    return math.inf if altitudes is None else altitudes


def _prior_strength(scheme: Scheme) -> float:
    """Return s of the rules, if they have a prior."""
    rule = scheme.edge_rule
    return rule.form.prior_strength if isinstance(rule, ScaleFreeEdgeRule) else 0.0
