"""All that is learned or chosen about interior edges, as one value: what the edges see and do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.arrays import Array
from pns_common.correction import Correction, Gate, Network, correct
from pns_common.feature_set import FeatureSet
from pns_common.frames import EdgeStencil, edge_stencil
from pns_common.orientation import Orientation
from pns_common.topology import Topology


@dataclass(frozen=True)
class EdgeOperator:
    """The learned rule for interior edges; ``network`` gives corrections for a budget of 1."""

    features: FeatureSet
    orientation: Orientation
    network: Network
    gate: Gate

    def look(
        self,
        points: Float[Array, "V 3"],
        normals: Float[Array, "F 3"],
        fields: Float[Array, "V M"] | None,
        topology: Topology,
        edges: Int[np.ndarray, " N"],
    ) -> EdgeStencil:
        """What some interior edges see; ``fields`` is the feature set's of the whole level."""
        ordered = self.orientation.order(topology, edges)
        return edge_stencil(points, normals, ordered.stencil, ordered.faces, fields)

    def correct(self, at: EdgeStencil, budget: float) -> Correction:
        """δ = h² γ F η(φ); ``budget`` is C / R, per unit of length.

        Raises:
            ModelError: the network returned something that is not finite.
        """
        return correct(at, self.features, self.network, self.gate, budget, self.orientation.frames)
