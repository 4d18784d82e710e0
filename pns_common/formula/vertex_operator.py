"""The learned vertex rule: what PNS adds to Loop's old vertices, where a model has it.

    format 3    p' = p0 + γ_v Π_ρ(D + τ ℓ_v Σ z_i e_i)      ‖z‖ ≤ 1,  ρ = C h_v² / R
    format 2    p' = p0 + h_v² γ_v (C / R) v                ‖v‖ ≤ 1,  γ_v = tanh(c_v x_v)

h_v² is the mean of the squared lengths of the vertex's edges, so h_v is no longer than the longest.
x_v is the mean over these edges of ‖n − n'‖² / 2: O(ε²) for a bump of height ε on a plane, so
that γ_v and its derivative vanish there. v = Σ z_i e_i is a sum of three equivariant vectors of
length ≤ 1 (rings.ring_vectors) with the network's z as weights, shortened to the unit ball where
it is longer. So ‖p' − p0‖ ≤ (C / R) h_v² for any weights, and each factor is Lipschitz.

The rule is off at vertices on boundary, irregular or crease edges, where several fans meet, and at
isolated ones; of format 3 it is on at darts, where one crease ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, gather, namespace
from pns_common.features.ring_features import RingFeatureSet
from pns_common.formula.correction import (
    BudgetPerLength,
    Correction,
    NetworkFunction,
    project_to_ball,
    shortened,
    where_allowed,
    where_open,
)
from pns_common.formula.gate import gate_of
from pns_common.geometry.rings import Rings, ring_vectors


@dataclass(frozen=True)
class VertexOperator:
    """The learned rule for old vertices.

    Attributes:
        features: of the ring.
        network: features (N, K) to weights z (N, 3), ‖z‖ ≤ 1.
        gate_sharpness: c_v of the gate tanh(c_v x_v).
    """

    features: RingFeatureSet
    network: NetworkFunction
    gate_sharpness: float

    def correct(
        self, rings: Rings, vertices: Int[np.ndarray, " N"], budget_per_length: BudgetPerLength
    ) -> Correction:
        """Return what is added at some vertices; ``budget_per_length`` is C / R.

        Raises:
            ModelError: the network returned something that is not finite, or of another shape.
        """
        xp = namespace(rings.normal)
        gamma, envelope, learned = self._evaluated(rings, vertices, budget_per_length)
        return Correction(
            displacement=(envelope * gamma)[:, None] * project_to_ball(learned),
            envelope=where_allowed(envelope, gamma),
            gate=gamma,
            degenerate=xp.zeros_like(gamma, dtype=xp.bool),
        )

    def correct_scale_free(
        self,
        rings: Rings,
        vertices: Int[np.ndarray, " N"],
        budget_per_length: BudgetPerLength,
        asked: Float[Array, "N 1"],
        prior: Float[Array, "N 3"],
    ) -> Correction:
        """Return δ = γ_v Π_ρ(D + τ ℓ_v Σ z_i e_i), ρ = h_v² C / R; likewise, with τ ℓ_v and D.

        Raises:
            ModelError: the network returned something that is not finite, or of another shape.
        """
        xp = namespace(rings.normal)
        gamma, envelope, learned = self._evaluated(rings, vertices, budget_per_length)
        wanted = prior + asked * learned
        displacement = gamma[:, None] * shortened(wanted, envelope)
        degenerate = xp.zeros_like(gamma, dtype=xp.bool)
        return Correction(displacement, where_allowed(envelope, gamma), gamma, degenerate)

    def _evaluated(
        self, rings: Rings, vertices: Int[np.ndarray, " N"], budget_per_length: BudgetPerLength
    ) -> tuple[Float[Array, " N"], Float[Array, " N"], Float[Array, "N 3"]]:
        """Return γ_v, ρ = h_v² C / R, and Σ z_i e_i."""
        xp = namespace(rings.normal)
        gamma = gate_of(self.gate_sharpness * gather(rings.mean_jump, vertices)[:, 0])
        envelope = budget_per_length * gather(rings.square, vertices)[:, 0]
        basis = gather(ring_vectors(rings), vertices)
        features = gather(self.features(rings), vertices)
        weights = project_to_ball(where_open(self.network, features, gamma, like=basis[:, 0]))
        return gamma, envelope, xp.sum(weights[:, :, None] * basis, axis=1)
