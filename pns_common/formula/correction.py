"""What PNS adds to Loop's edge vertices, and the bound that it never leaves.

    the paper's equation 1 (models of formats 1 and 2), by ``correct``:

        q = q0 + h² γ F η(φ)                ‖η‖ ≤ C / R

    the default model's (format 3), by ``correct_scale_free``:

        q = q0 + γ Π_ρ(D + τ ℓ F z(φ))      ‖z‖ ≤ 1,  ρ = C h² / R

    γ = tanh(c x²),  x = 1 − n1 · n2

q0 is Loop's edge vertex (masks/stencils.py), h the edge's length, F its frame (geometry/frames.py),
φ what the network reads of its surroundings (features/edge_features.py), η and z what it answers, D
a prior without weights (prior.py), C the budget and R the mesh's unit of length
(geometry/reference_length.py). Π_ρ shortens to ρ. Beside thin faces ℓ is less than h, and h in ρ
more (geometry/thin_faces.py); on others both are h. The default's γ is open beside gentle bends too
(side_gate.py). Old vertices get the like of it in vertex_operator.py, and fold_guard.py scales
back what would fold.

The bound is enforced here, in float64 and whatever the network returns: ‖δ‖ ≤ C h² / R for any
weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from pns_common.base.arrays import Array, as_numpy, detached, namespace, norm
from pns_common.errors import ModelError
from pns_common.formula.gate import gate_of
from pns_common.geometry.frames import EdgeFrames, EdgeStencil, edge_frames, rotate
from pns_common.geometry.thin_faces import longest_side

# Features (N, K) -> local vectors (N, 3), η for C / R = 1, or z; shortened to length 1 afterwards.
NetworkFunction = Callable[[Array], Array]
# Points, normals and frames of N edges -> their features φ (N, K).
Features = Callable[[EdgeStencil, EdgeFrames], Array]
# Curvatures x of N edges -> γ (N,) ∈ [0, 1].
Gate = Callable[[Array], Array]
# The same of their frames: x, and where there is none.
FrameGate = Callable[[EdgeFrames], Array]
# C / R, per unit of length: one number, or one for each row where parts have their own R.
BudgetPerLength = float | Float[np.ndarray, " N"]


@dataclass(frozen=True, eq=False)
class Correction:
    """What N interior edges add to Loop's edge vertices.

    Attributes:
        displacement: δ, in the mesh's coordinates.
        envelope: the largest length that δ may have, in the mesh's units: ρ = C h² / R, but 0 where
            the gate is shut, since nothing is added there whatever the network says.
        gate: γ ∈ [0, 1].
        degenerate: edges whose frame is the fallback.
    """

    displacement: Float[Array, "N 3"]
    envelope: Float[Array, " N"]
    gate: Float[Array, " N"]
    degenerate: Bool[Array, " N"]


def curvature_gate(gate_sharpness: float) -> Gate:
    """Return γ = tanh(c x²): 0, with derivative 0, where both faces are coplanar (equation 5)."""
    # No function of its own: that could not be sent to another process.
    return partial(_gate_of_curvature, gate_sharpness)


def _gate_of_curvature(gate_sharpness: float, curvature: Array) -> Array:
    return gate_of(gate_sharpness * curvature**2)


def by_curvature(gate: Gate) -> FrameGate:
    """Return a gate of x as one of frames."""

    def of_frames(frames: EdgeFrames) -> Array:
        return gate(frames.curvature)

    return of_frames


def project_to_ball(vectors: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Shorten vectors longer than 1 to that, also huge ones; none is lengthened."""
    xp = namespace(vectors)
    # Dividing by the largest component first keeps the square of a huge vector finite.
    size = xp.abs(vectors)
    largest = xp.maximum(xp.maximum(size[:, 0], size[:, 1]), size[:, 2])
    scale = xp.where(largest > 1, largest, 1.0)[:, None]
    length = norm(vectors / scale)[:, None] * scale
    return vectors * (1.0 / xp.where(length > 1, length, 1.0))


def correct(
    stencil: EdgeStencil,
    features: Features,
    network: NetworkFunction,
    gate: Gate,
    budget_per_length: BudgetPerLength,
    frames_of: Callable[[EdgeStencil], EdgeFrames] = edge_frames,
) -> Correction:
    """Return δ = h² γ F η(φ) at interior edges (equation 1); ``budget_per_length`` is C / R.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    frames = frames_of(stencil)
    gamma = gate(frames.curvature)
    eta = where_open(network, features(stencil, frames), gamma, like=stencil.a)
    envelope = budget_per_length * frames.length**2
    local = project_to_ball(eta)
    displacement = (envelope * gamma)[:, None] * rotate(frames, local)
    return Correction(displacement, where_allowed(envelope, gamma), gamma, frames.degenerate)


def shortened(vectors: Float[Array, "N 3"], longest: Float[Array, " N"]) -> Float[Array, "N 3"]:
    """Return Π_ρ of vectors: those longer than ρ = ``longest`` shortened to it, none lengthened."""
    xp = namespace(vectors)
    length = norm(vectors)
    long = length > longest
    return vectors * xp.where(long, longest / xp.where(long, length, 1.0), 1.0)[:, None]


def correct_scale_free(
    stencil: EdgeStencil,
    features: Features,
    network: NetworkFunction,
    gate: FrameGate,
    budget_per_length: BudgetPerLength,
    frames_of: Callable[[EdgeStencil], EdgeFrames],
    asked: Float[Array, " N"],
    prior: Float[Array, "N 3"],
    wide_bound: bool,
) -> Correction:
    """Return δ = γ Π_ρ(D + τ ℓ F z(φ)), ρ = h² C / R, at interior edges.

    It is equation 1 with η = Π_C(R (Fᵀ D + τ ℓ z) / h²) / R: the bound is the same, and the network
    speaks in units of h, so what it says holds at every resolution. ``budget_per_length`` is C / R,
    ``asked`` is τ ℓ, ``prior`` is D. Beside thin faces ℓ is shorter than h, and with a
    ``wide_bound`` h is h̄ (geometry/thin_faces.py).

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    frames = frames_of(stencil)
    gamma = gate(frames)
    z = project_to_ball(where_open(network, features(stencil, frames), gamma, like=stencil.a))
    wanted = prior + asked[:, None] * rotate(frames, z)
    length = longest_side(stencil, frames) if wide_bound else frames.length
    envelope = budget_per_length * length**2
    displacement = gamma[:, None] * shortened(wanted, envelope)
    return Correction(displacement, where_allowed(envelope, gamma), gamma, frames.degenerate)


def where_allowed(envelope: Float[Array, " N"], gate: Float[Array, " N"]) -> Float[Array, " N"]:
    """Return ρ, 0 where the gate is shut."""
    return namespace(envelope).where(gate != 0, envelope, 0.0)


def where_open(
    network: NetworkFunction, features: Array, gate: Float[Array, " N"], like: Float[Array, "N 3"]
) -> Array:
    """Return the network's answers, checked; 0 in rows whose gate is shut, for which it is not run.

    Nothing is added there whatever it says, and no other row is changed by their absence. Tensors,
    which may keep a gradient, are all run. ``like`` has the type and precision of the geometry.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    # Where all are open, as most are, finding them would take seven times as long.
    is_open = as_numpy(gate) != 0
    if is_open.all() or as_numpy(like) is not like:
        return checked_answer(network(features), like)
    rows, answers = np.flatnonzero(is_open), np.zeros(like.shape)
    if len(rows):
        # Taken, not indexed: three times as fast. ``like`` lends its shape alone.
        asked = np.take(as_numpy(features), rows, axis=0)
        answers[rows] = checked_answer(network(asked), like[: len(rows)])
    return answers


def checked_answer(eta: Array, like: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return the network's answer in the geometry's precision, refused unless (N, 3) and finite.

    Raises:
        ModelError: it is not.
    """
    xp = namespace(like)
    if type(like) is np.ndarray:
        # A model of one's own may answer in lists, or by a tensor.
        eta = np.asarray(detached(eta))
        if eta.dtype.kind not in "fiub":
            raise ModelError("network", expected="real numbers", found=f"{eta.dtype}")
    if tuple(eta.shape) != tuple(like.shape):
        raise ModelError(
            "network", expected=f"corrections of shape {tuple(like.shape)}", found=f"{eta.shape}"
        )
    if not bool(xp.all(xp.isfinite(eta))):
        raise ModelError("network", expected="finite corrections", found="NaN or infinity")
    return xp.astype(eta, like.dtype, copy=False)


def proximity_ratio(correction: Correction) -> Float[Array, " N"]:
    """Return ‖δ‖ R / (C h²) ∈ [0, 1]; 0 where the envelope is empty."""
    xp = namespace(correction.envelope)
    open_ = correction.envelope > 0
    return xp.where(
        open_, norm(correction.displacement) / xp.where(open_, correction.envelope, 1.0), 0.0
    )
