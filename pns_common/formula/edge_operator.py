"""All that is learned or chosen about interior edges, as one value: what the edges see and do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array
from pns_common.connectivity.topology import Topology
from pns_common.features.feature_set import FeatureSet
from pns_common.features.orientation import Orientation
from pns_common.formula.correction import (
    BudgetPerLength,
    Correction,
    FrameGate,
    Gate,
    NetworkFunction,
    correct,
    correct_scale_free,
)
from pns_common.geometry.frames import EdgeStencil, edge_stencil


@dataclass(frozen=True)
class EdgeOperator:
    """The learned rule for interior edges; ``network`` gives corrections for a budget of 1."""

    features: FeatureSet
    orientation: Orientation
    network: NetworkFunction
    gate: Gate

    def stencil(
        self,
        points: Float[Array, "V 3"],
        normals: Float[Array, "F 3"],
        fields: Float[Array, "V M"] | None,
        topology: Topology,
        edges: Int[np.ndarray, " N"],
    ) -> EdgeStencil:
        """Gather what some interior edges see; ``fields`` is the feature set's of a whole level."""
        ordered = self.orientation.order(topology, edges)
        return edge_stencil(points, normals, ordered.stencil, ordered.faces, fields)

    def correct(self, stencil: EdgeStencil, budget_per_length: BudgetPerLength) -> Correction:
        """Return δ = h² γ F η(φ); ``budget_per_length`` is C / R.

        Raises:
            ModelError: the network returned something that is not finite, or of another shape.
        """
        return correct(
            stencil,
            self.features,
            self.network,
            self.gate,
            budget_per_length,
            self.orientation.frames,
        )

    def correct_scale_free(
        self,
        stencil: EdgeStencil,
        budget_per_length: BudgetPerLength,
        asked: Float[Array, " N"],
        prior: Float[Array, "N 3"],
        gate: FrameGate,
        wide_bound: bool,
    ) -> Correction:
        """Return δ = γ Π_ρ(D + τ ℓ F z(φ)); ``asked`` is τ ℓ, and ``gate`` serves for its own."""
        return correct_scale_free(
            stencil,
            self.features,
            self.network,
            gate,
            budget_per_length,
            self.orientation.frames,
            asked,
            prior,
            wide_bound,
        )
