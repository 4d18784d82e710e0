"""The learned vertex rule: what PNS adds to Loop's old vertices, where a model has it.

    p' = p0 + h_v² · γ_v · (C / R) · v        ‖v‖ ≤ 1,  γ_v = tanh(c x_v)

h_v² is the mean of the squared lengths of the ring's edges, so h_v is no longer than the longest.
x_v is the mean over the ring's edges of ‖n − n'‖² / 2: O(ε²) for a bump of height ε on a plane, so
that γ_v and its derivative vanish there. v = Σ z_i e_i is a sum of three equivariant vectors of
length ≤ 1 (see ring_features.py) with the network's z as weights, shortened to the unit ball where
it is longer. So ‖p' − p0‖ ≤ (C / R) h_v² for any weights, and each factor is Lipschitz.

The rule is off at vertices on boundary, irregular or crease edges, where several fans meet, and at
isolated ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pns_common.arrays import gather, namespace
from pns_common.correction import Correction, Network, finite, project_to_ball
from pns_common.ring_features import RingFeatureSet, Rings, ring_vectors
from pns_common.topology import Topology, multi_fan_vertices, sharp_edge_count


@dataclass(frozen=True)
class VertexOperator:
    """The learned rule for old vertices.

    Attributes:
        features: of the ring.
        network: features (N, K) to weights z (N, 3), ‖z‖ ≤ 1.
        sharpness: c of the gate tanh(c x_v).
    """

    features: RingFeatureSet
    network: Network
    sharpness: float

    def correct(self, rings: Rings, vertices: Int[np.ndarray, " N"], budget: float) -> Correction:
        """What is added at some vertices; ``budget`` is C / R, per unit of length.

        Raises:
            ModelError: the network returned something that is not finite.
        """
        xp = namespace(rings.normal)
        gamma = xp.tanh(self.sharpness * gather(rings.sharpness, vertices)[:, 0])
        envelope = budget * gather(rings.square, vertices)[:, 0]
        basis = gather(ring_vectors(rings), vertices)
        z = self.network(gather(self.features(rings), vertices))
        weights = project_to_ball(finite(z, like=basis[:, 0]))
        vector = project_to_ball(xp.sum(weights[:, :, None] * basis, axis=1))
        return Correction(
            displacement=(envelope * gamma)[:, None] * vector,
            envelope=envelope,
            gate=gamma,
            degenerate=xp.zeros_like(gamma, dtype=xp.bool),
        )


def smooth_vertices(topology: Topology) -> Bool[np.ndarray, " V"]:
    """Vertices with a closed ring of interior edges: those that the rule may move."""
    used = np.zeros(topology.vertex_count, dtype=bool)
    used[topology.edges.reshape(-1)] = True
    return used & (sharp_edge_count(topology) == 0) & ~multi_fan_vertices(topology)
