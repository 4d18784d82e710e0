"""Schemes: a scheme is a vertex rule and an edge rule.

A rule takes a control level and places its new vertices; both rules of a scheme are functions, so a
new scheme is two functions and no change here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from pns_common.arrays import Array
from pns_common.blocks import Blocks
from pns_common.correction import curvature_gate, proximity_ratio
from pns_common.edge_operator import EdgeOperator
from pns_common.errors import ModelError, ParameterError
from pns_common.features import FEATURE_SETS
from pns_common.model_card import ModelCard
from pns_common.orientation import ORIENTATIONS
from pns_common.parameters import is_number
from pns_common.ring_features import RING_FEATURE_SETS, look_around
from pns_common.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.topology import Topology
from pns_common.vertex_operator import VertexOperator, smooth_vertices


@runtime_checkable
class Model(Protocol):
    """A per-edge network with its card; ``model(features, budget)`` has norm ≤ budget."""

    @property
    def card(self) -> ModelCard:
        """What the model says of itself."""
        ...

    @property
    def name(self) -> str:
        """How reports call it."""
        ...

    @property
    def hash(self) -> str:
        """The sha256 of the model file."""
        ...

    def __call__(self, features: Array, budget: float) -> Array:
        """Corrections (N, 3) in the edge frame for features (N, K)."""
        ...


@runtime_checkable
class VertexModel(Model, Protocol):
    """A model with a second network, for old vertices."""

    def vertex_correction(self, features: Array, budget: float) -> Array:
        """Weights (N, 3) of the ring's three vectors for features (N, L); norm ≤ budget."""
        ...


@dataclass(frozen=True, eq=False)
class ControlLevel:
    """What a rule may look at: one level's mesh, before refinement.

    ``reference_length`` is R, the unit of length of the budget, fixed at level 0; 0 switches
    corrections off.
    """

    points: Float[np.ndarray, "V 3"]
    topology: Topology
    normals: Float[np.ndarray, "F 3"]
    reference_length: float
    blocks: Blocks


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a rule puts its N vertices: Loop's position plus a displacement.

    Attributes:
        loop: Loop's positions q0.
        displacement: what is added to them; None where the rule is Loop's.
        ratio: proximity ratio ‖δ‖ / (C h²), 0 for Loop.
        gate: γ, 0 where there is no correction.
        degenerate: vertices whose frame was the fallback.
        corrected: of a vertex rule that is not Loop's, the vertices that it may move.
    """

    loop: Float[np.ndarray, "N 3"]
    displacement: Float[np.ndarray, "N 3"] | None
    ratio: Float[np.ndarray, " N"]
    gate: Float[np.ndarray, " N"]
    degenerate: Bool[np.ndarray, " N"]
    corrected: Bool[np.ndarray, " N"] | None = None

    @property
    def positions(self) -> Float[np.ndarray, "N 3"]:
        """q = q0 + δ."""
        return self.loop if self.displacement is None else self.loop + self.displacement


Rule = Callable[[ControlLevel], Placement]


@dataclass(frozen=True)
class Scheme:
    """A refinement rule for triangle meshes.

    ``budget`` (C), ``model`` and ``model_hash`` are for reports and None where there is none.
    """

    name: str
    vertex_rule: Rule
    edge_rule: Rule
    budget: float | None = None
    model: str | None = None
    model_hash: str | None = None


def loop() -> Scheme:
    """Loop subdivision (Loop 1987)."""
    return Scheme("loop", loop_vertex_rule, loop_edge_rule)


def pns(model: Model, budget: float | None = None) -> Scheme:
    """Proximity-Preserving Neural Subdivision with a model.

    Args:
        model: from ``load_model``, or anything that keeps the protocol.
        budget: C ≥ 0, dimensionless; None takes the one that the model was trained at.

    Raises:
        ParameterError: the budget is negative or not finite.
    """
    budget = model.card.budget if budget is None else budget
    if not (is_number(budget) and budget >= 0):
        raise ParameterError("budget", budget, expected="a finite number ≥ 0")
    vertices = vertex_operator(model)
    return Scheme(
        "pns",
        loop_vertex_rule if vertices is None else learned_vertex_rule(vertices, float(budget)),
        learned_edge_rule(edge_operator(model), float(budget)),
        budget=float(budget),
        model=model.name,
        model_hash=model.hash,
    )


def loop_vertex_rule(level: ControlLevel) -> Placement:
    """Loop's rule for old vertices."""
    return without_correction(loop_vertex_vertices(level.points, level.topology))


def loop_edge_rule(level: ControlLevel) -> Placement:
    """Loop's rule for edge vertices."""
    positions = np.empty((len(level.topology.edges), 3))

    def place(rows: slice) -> None:
        positions[rows] = loop_edge_vertices(level.points, level.topology, rows)

    level.blocks.run(len(positions), place)
    return without_correction(positions)


def without_correction(positions: Float[np.ndarray, "N 3"]) -> Placement:
    """A placement that is Loop's."""
    nothing = np.zeros(len(positions))
    return Placement(positions, None, nothing, nothing, np.zeros(len(positions), dtype=bool))


def edge_operator(model: Model) -> EdgeOperator:
    """What a model's card and network make of interior edges."""

    def network(rows: Array) -> Array:
        # The unit budget, scaled in float64 afterwards: one file serves every C / R exactly.
        return model(rows, 1.0)

    return EdgeOperator(
        FEATURE_SETS[model.card.features],
        ORIENTATIONS[model.card.orientation],
        network,
        curvature_gate(model.card.gate_sharpness),
    )


def vertex_operator(model: Model) -> VertexOperator | None:
    """What a model makes of old vertices; None where it leaves them to Loop.

    Raises:
        ModelError: the card names vertex features, and the model has no network for them.
    """
    card = model.card
    if card.vertex_features is None or card.vertex_gate_sharpness is None:
        return None
    if not isinstance(model, VertexModel):
        raise ModelError(model.name, expected="a vertex network, as on the card", found="none")

    def network(rows: Array) -> Array:
        return model.vertex_correction(rows, 1.0)

    features = RING_FEATURE_SETS[card.vertex_features]
    return VertexOperator(features, network, card.vertex_gate_sharpness)


def learned_vertex_rule(operator: VertexOperator, budget: float) -> Rule:
    """p' = p0 + h_v² γ_v (C / R) v on closed rings, Loop's rule on all others; ``budget`` is C."""

    def vertex_rule(level: ControlLevel) -> Placement:
        base = loop_vertex_rule(level)
        if level.reference_length == 0:
            return base
        corrected = smooth_vertices(level.topology)
        rows = np.flatnonzero(corrected)
        rings = look_around(level.points, level.normals, level.topology)
        result = operator.correct(rings, rows, budget / level.reference_length)
        displacement, ratio = np.zeros_like(base.loop), base.ratio.copy()
        gamma = base.gate.copy()
        displacement[rows], gamma[rows] = result.displacement, result.gate
        ratio[rows] = proximity_ratio(result)
        return Placement(base.loop, displacement, ratio, gamma, base.degenerate, corrected)

    return vertex_rule


def learned_edge_rule(operator: EdgeOperator, budget: float) -> Rule:
    """q = q0 + h² γ F η(φ) on interior edges, the midpoint on all others; ``budget`` is C."""

    def edge_rule(level: ControlLevel) -> Placement:
        base = loop_edge_rule(level)
        if level.reference_length == 0:
            return base
        topology, count = level.topology, len(level.topology.edges)
        displacement, ratio = np.zeros((count, 3)), np.zeros(count)
        gamma, degenerate = np.zeros(count), np.zeros(count, dtype=bool)
        fields = operator.features.fields(level.points, topology)

        def correct_block(rows: slice) -> None:
            edges = topology.interior[rows]
            at = operator.look(level.points, level.normals, fields, topology, edges)
            result = operator.correct(at, budget / level.reference_length)
            displacement[edges] = result.displacement
            ratio[edges] = proximity_ratio(result)
            gamma[edges], degenerate[edges] = result.gate, result.degenerate

        level.blocks.run(len(topology.interior), correct_block)
        return Placement(base.loop, displacement, ratio, gamma, degenerate)

    return edge_rule
