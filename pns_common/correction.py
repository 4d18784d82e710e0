"""The learned correction δ = h² γ F η(φ), the whole of what PNS adds to Loop (equation 1).

    q = q0 + h² · γ · F · η(φ)        ‖η‖ ≤ C,  γ = tanh(c x²),  x = 1 − n1 · n2

The bound is enforced here, in float64 and whatever the network returns: ‖δ‖ ≤ C h² for any weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Bool, Float

from pns_common.arrays import Array, namespace, norm
from pns_common.errors import ModelError
from pns_common.frames import EdgeFrames, EdgeStencil, edge_frames, rotate

# Features (N, K) -> local corrections (N, 3) for a budget of 1.
Network = Callable[[Array], Array]
# Points and normals (N) -> features (N, K).
Features = Callable[[EdgeStencil, EdgeFrames], Array]
# Curvature x and frames -> γ ∈ [0, 1].
Gate = Callable[[EdgeFrames], Array]


@dataclass(frozen=True, eq=False)
class Correction:
    """What N interior edges add to Loop's edge vertices.

    Attributes:
        displacement: δ = h² γ F η, world coordinates.
        envelope: C h², the largest length that δ may have.
        gate: γ ∈ [0, 1].
        degenerate: edges whose frame is the fallback.
    """

    displacement: Float[Array, "N 3"]
    envelope: Float[Array, " N"]
    gate: Float[Array, " N"]
    degenerate: Bool[Array, " N"]


def curvature_gate(sharpness: float) -> Gate:
    """γ = tanh(c x²): 0, with derivative 0, where the two faces are coplanar (equation 4)."""

    def gate(frames: EdgeFrames) -> Array:
        return namespace(frames.curvature).tanh(sharpness * frames.curvature**2)

    return gate


def project_to_ball(vectors: Float[Array, "N 3"], radius: float = 1.0) -> Float[Array, "N 3"]:
    """Vectors longer than ``radius`` are shortened to it; none is lengthened."""
    xp = namespace(vectors)
    # Dividing by the largest component first keeps the square of a huge vector finite.
    size = xp.abs(vectors)
    largest = xp.maximum(xp.maximum(size[:, 0], size[:, 1]), size[:, 2])
    scale = xp.where(largest > 1, largest, 1.0)[:, None]
    length = norm(vectors / scale)[:, None] * scale
    return vectors * (radius / xp.where(length > radius, length, radius))


def correct(
    at: EdgeStencil,
    features: Features,
    network: Network,
    gate: Gate,
    budget: float,
    frames_of: Callable[[EdgeStencil], EdgeFrames] = edge_frames,
) -> Correction:
    """δ = h² γ F η(φ) for interior edges; ``budget`` is C / R, per unit of length.

    Raises:
        ModelError: the network returned something that is not finite.
    """
    frames = frames_of(at)
    gamma = gate(frames)
    eta = network(features(at, frames))
    envelope = budget * frames.length**2
    local = project_to_ball(finite(eta, like=at.a))
    displacement = (envelope * gamma)[:, None] * rotate(frames, local)
    return Correction(displacement, envelope, gamma, frames.degenerate)


def finite(eta: Array, like: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """The network's answer in the geometry's precision, refused unless (N, 3) and finite."""
    xp = namespace(like)
    if tuple(eta.shape) != tuple(like.shape):
        raise ModelError(
            "network", expected=f"corrections of shape {tuple(like.shape)}", found=f"{eta.shape}"
        )
    if not bool(xp.all(xp.isfinite(eta))):
        raise ModelError("network", expected="finite corrections", found="NaN or infinity")
    return xp.astype(eta, like.dtype, copy=False)


def proximity_ratio(correction: Correction) -> Float[Array, " N"]:
    """‖δ‖ / (C h²) ∈ [0, 1]; 0 where the envelope is empty."""
    xp = namespace(correction.envelope)
    open_ = correction.envelope > 0
    return xp.where(
        open_, norm(correction.displacement) / xp.where(open_, correction.envelope, 1.0), 0.0
    )
