"""The numbers of the scale-free rule."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pns_common.formula.prior_strength import prior_strength
from pns_common.geometry.side_lengths import SideLengths


@dataclass(frozen=True)
class ScaleFreeForm:
    """The numbers of the rule, as they stand on a card of format 3.

    Attributes:
        budget: C ≥ 0; C / R bounds the displacement per squared length.
        prior_strength: s ≥ 0 of the prior D; 1 is full quasi-interpolation.
        network_scale: τ > 0, the longest that the network may ask for at an edge, in its lengths.
        fold_angle: θ of the fold guard in degrees, 0 < θ < 90.
        learned_levels: K ≥ 1.
        boundary_strength: b ≥ 0 of the prior of curves; 1 is full quasi-interpolation.
        side_gates: whether an edge's gate reads the sides of its two faces beside their normals.
        network_altitudes: α > 0, the longest that τ's unit may be, in altitudes of the thinner
            face; None counts edge lengths alone.
        wide_bound: whether h of an edge's bound is the longest edge of its two faces.
        crease_prior: whether creases are such curves too; else boundaries alone are.
        tip_strength: a ≥ 0, how much of Loop's own move is given back at tips; 0: none.
        even_prior_strength: s₁ ≥ 0 of even meshes; None: s is ``prior_strength`` for any mesh.
    """

    budget: float
    prior_strength: float
    network_scale: float
    fold_angle: float
    learned_levels: int
    boundary_strength: float = 0.0
    side_gates: bool = False
    network_altitudes: float | None = None
    wide_bound: bool = False
    crease_prior: bool = False
    tip_strength: float = 0.0
    even_prior_strength: float | None = None

    def fitted(self, sides: Callable[[], SideLengths]) -> ScaleFreeForm:
        """Return the same with s of a mesh; ``sides`` measures it, where that is asked for."""
        even = self.even_prior_strength
        if even is None:
            return self
        strength = prior_strength(self.prior_strength, even, sides())
        return replace(self, prior_strength=strength, even_prior_strength=None)
