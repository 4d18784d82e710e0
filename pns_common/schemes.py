"""Schemes: a scheme is a vertex rule and an edge rule, and how many levels they act at.

A rule takes a control level and places its new vertices; both rules of a scheme are functions, so a
new scheme is two functions and no change here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from pns_common.base.arrays import Array
from pns_common.base.parameters import is_number, is_whole
from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.errors import ModelError, ParameterError
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.orientation import ORIENTATIONS
from pns_common.features.ring_features import RING_FEATURE_SETS
from pns_common.formula.correction import curvature_gate
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.fold_guard import FoldGuard
from pns_common.formula.prior_strength import HIGHEST_STRENGTH
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.geometry.side_lengths import SideLengths
from pns_common.models.card import ModelCard
from pns_common.models.protocol import Model, VertexModel
from pns_common.rules.control_level import ControlLevel, Rule
from pns_common.rules.curves import CurveRule
from pns_common.rules.learned import LearnedEdgeRule, LearnedVertexRule
from pns_common.rules.loop import loop_edge_rule, loop_vertex_rule
from pns_common.rules.placement import Placement, placed_at, without_correction
from pns_common.rules.scale_free import ScaleFreeEdgeRule, ScaleFreeVertexRule
from pns_common.rules.scale_free_form import ScaleFreeForm

__all__ = [
    "ControlLevel",
    "LearnedEdgeRule",
    "LearnedVertexRule",
    "Model",
    "Placement",
    "Rule",
    "Scheme",
    "VertexModel",
    "edge_operator",
    "loop",
    "loop_edge_rule",
    "loop_vertex_rule",
    "placed_at",
    "pns",
    "scale_free_scheme",
    "vertex_operator",
    "without_correction",
]


@dataclass(frozen=True)
class Scheme:
    """A refinement rule for triangle meshes.

    Reports measure how far a rule puts vertices from Loop's by the ``displacement`` of its
    placements: a rule of your own says it with ``placed_at``.

    Attributes:
        name: how reports call it.
        vertex_rule, edge_rule: where new vertices go.
        budget, model, model_hash: for reports; None where there is none.
        learned_levels: K, at so many levels the rules act, and then Loop. None: at every level.
        guard: what scales the displacements of a level back where a child face would fold.
        moves_boundaries: whether the rules move boundaries, by the boundary alone.
        wide_bound: whether h of an edge's bound C h² / R is the longest edge of its two faces.
        creases: those that it keeps unless others are named.

    Raises:
        ParameterError: a rule that cannot be called, or levels that are no whole number from 0 on.
    """

    name: str
    vertex_rule: Rule = field(repr=False)
    edge_rule: Rule = field(repr=False)
    budget: float | None = None
    model: str | None = None
    model_hash: str | None = field(default=None, repr=False)
    learned_levels: int | None = None
    guard: FoldGuard | None = field(default=None, repr=False)
    moves_boundaries: bool = field(default=False, repr=False)
    wide_bound: bool = field(default=False, repr=False)
    creases: Creases = field(default=NO_CREASES, repr=False)

    def __post_init__(self) -> None:
        for name, rule in (("vertex_rule", self.vertex_rule), ("edge_rule", self.edge_rule)):
            if not callable(rule):
                raise ParameterError(name, rule, expected="a function from a level to a placement")
        levels = self.learned_levels
        if levels is not None and not (is_whole(levels) and levels >= 0):
            raise ParameterError("learned_levels", levels, expected="a whole number, or None")

    @property
    def prior_strength(self) -> float | None:
        """Return s of the rules' prior; None where they have none, or none of a mesh's own yet."""
        rule = self.edge_rule
        if not isinstance(rule, ScaleFreeEdgeRule) or rule.form.even_prior_strength is not None:
            return None
        return rule.form.prior_strength

    def acts_at(self, depth: int) -> bool:
        """Return whether the rules act at a level, 0 the control mesh's; else Loop does."""
        return self.learned_levels is None or depth < self.learned_levels

    def fitted(self, sides: Callable[[], SideLengths]) -> Scheme:
        """Return the same for a mesh (formula/prior_strength.py).

        ``sides`` measures its faces' sides; it is called where the rules depend on them.
        """
        edges, vertices = self.edge_rule, self.vertex_rule
        if not (isinstance(edges, ScaleFreeEdgeRule) and isinstance(vertices, ScaleFreeVertexRule)):
            return self
        form = edges.form.fitted(sides)
        if form is edges.form:
            return self
        return replace(
            self, edge_rule=replace(edges, form=form), vertex_rule=replace(vertices, form=form)
        )


def loop() -> Scheme:
    """Return the scheme of Loop subdivision (Loop 1987)."""
    return Scheme("loop", loop_vertex_rule, loop_edge_rule, learned_levels=0)


def pns(model: Model, budget: float | None = None, prior_strength: float | None = None) -> Scheme:
    """Return the scheme of Proximity-Preserving Neural Subdivision with a model.

    Args:
        model: from ``load_model``, or anything that keeps the protocol.
        budget: C ≥ 0, dimensionless; None takes the one that the model was trained at.
        prior_strength: s of the prior, 0 … 100, the same for all meshes, as for parts that are to
            go together; None: what each mesh calls for (formula/prior_strength.py).

    Raises:
        ParameterError: the budget is negative or not finite, the strength is out of range, the
            model has no prior to be of that strength, or this is no model.
        ModelError: the card names vertex features, and the model has no network for them.
    """
    if not isinstance(model, Model):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ParameterError("model", type(model), expected="a model, as load_model() gives it")
    card = model.card
    budget = card.budget if budget is None else budget
    if not (is_number(budget) and budget >= 0):
        raise ParameterError("budget", budget, expected="a finite number ≥ 0")
    budget = float(budget)
    edges, vertices = edge_operator(model), vertex_operator(model)
    form = _with_strength(scale_free_form(card, budget), prior_strength)
    if form is not None and vertices is not None:
        # Without a budget it is Loop, to the bit.
        kept = Creases(
            line_angle=card.crease_angle,
            levels=card.crease_levels,
            edged_angle=card.edged_crease_angle,
        )
        creases = kept if budget > 0 else NO_CREASES
        return scale_free_scheme(edges, vertices, form, model.name, model.hash, creases)
    return Scheme(
        "pns",
        loop_vertex_rule if vertices is None else LearnedVertexRule(vertices, budget),
        LearnedEdgeRule(edges, budget),
        budget=budget,
        model=model.name,
        model_hash=model.hash,
    )


def _with_strength(form: ScaleFreeForm | None, given: float | None) -> ScaleFreeForm | None:
    if given is None:
        return form
    if form is None:
        expected = "None: the model has no prior"
        raise ParameterError("prior_strength", given, expected=expected)
    if not (is_number(given) and 0 <= given <= HIGHEST_STRENGTH):
        expected = f"a number, 0 … {HIGHEST_STRENGTH:g}"
        raise ParameterError("prior_strength", given, expected=expected)
    return replace(form, prior_strength=float(given), even_prior_strength=None)


def scale_free_scheme(
    edges: EdgeOperator,
    vertices: VertexOperator,
    form: ScaleFreeForm,
    model: str | None = None,
    model_hash: str | None = None,
    creases: Creases = NO_CREASES,
) -> Scheme:
    """Return the default scheme: scale-free rules at K levels, each guarded, then Loop.

    ``creases`` are those that it keeps unless others are named.
    """
    curves = CurveRule(form, vertices.gate_sharpness) if form.boundary_strength > 0 else None
    return Scheme(
        "pns",
        ScaleFreeVertexRule(vertices, form, curves),
        ScaleFreeEdgeRule(edges, form, curves, vertices.gate_sharpness),
        budget=form.budget,
        model=model,
        model_hash=model_hash,
        learned_levels=form.learned_levels,
        guard=FoldGuard(math.radians(form.fold_angle)),
        moves_boundaries=curves is not None,
        wide_bound=form.wide_bound,
        creases=creases,
    )


def scale_free_form(card: ModelCard, budget: float) -> ScaleFreeForm | None:
    """Return the numbers of a card of format 3 with another budget; None for older cards."""
    strength, scale = card.prior_strength, card.network_scale
    angle, levels = card.fold_angle, card.learned_levels
    if strength is None or scale is None or angle is None or levels is None:
        return None
    return ScaleFreeForm(
        budget,
        strength,
        scale,
        angle,
        levels,
        boundary_strength=card.boundary_strength or 0.0,
        side_gates=card.side_gates or False,
        network_altitudes=card.network_altitudes,
        wide_bound=card.wide_bound or False,
        crease_prior=card.crease_prior or False,
        tip_strength=card.tip_strength or 0.0,
        even_prior_strength=card.even_prior_strength,
    )


def edge_operator(model: Model) -> EdgeOperator:
    """Return what a model's card and network make of interior edges."""
    return EdgeOperator(
        FEATURE_SETS[model.card.features],
        ORIENTATIONS[model.card.orientation],
        partial(_edges_at_unit_budget, model),
        curvature_gate(model.card.gate_sharpness),
    )


def vertex_operator(model: Model) -> VertexOperator | None:
    """Return what a model makes of old vertices; None where it leaves them to Loop.

    Raises:
        ModelError: the card names vertex features, and the model has no network for them.
    """
    card = model.card
    if card.vertex_features is None or card.vertex_gate_sharpness is None:
        return None
    if not isinstance(model, VertexModel):
        raise ModelError(model.name, expected="a vertex network, as on the card", found="none")
    features = RING_FEATURE_SETS[card.vertex_features]
    network = partial(_vertices_at_unit_budget, model)
    return VertexOperator(features, network, card.vertex_gate_sharpness)


# The unit budget, scaled in float64 afterwards: one file serves every C / R exactly. Functions of
# the module, so that a scheme can be sent to another process, as its model can.


def _edges_at_unit_budget(model: Model, rows: Array) -> Array:
    return model(rows, 1.0)


def _vertices_at_unit_budget(model: VertexModel, rows: Array) -> Array:
    return model.vertex_correction(rows, 1.0)
