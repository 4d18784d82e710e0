"""Limit tangents of a sector: two masks whose cross product is the surface's normal there.

Tangent masks are left eigenvectors of the local subdivision matrix for its subdominant eigenvalues.
With q_0 … q_k the neighbours of p in a sector of k faces, anticlockwise:

    closed       Σ cos(2πj/k) q_j  and  Σ sin(2πj/k) q_j
    curve        q_0 − q_k  and  c p + a (q_0 + q_k) + Σ sin(πj/k) q_j       0 < j < k
                 a = (sin(π/k) − S) / (8 λ − 2), c = −S − 2 a, S = Σ sin(πj/k),
                 λ = 3/8 + cos(π/k) / 4; for k = 1 the second difference, a = 1/2, c = −1
    corner       q_0 − p  and  q_k − p
    dart         Σ sin(2πj/k) q_j and the even eigenvector, of which one number is solved for

At k = 3 the curve's are the masks of Hoppe et al. 1994 for a regular crease; elsewhere theirs
belong to their own rules next to creases, which are not the ones used here. Where another mode
shrinks no faster than these, Loop's surface has no tangent plane, and we call the plane of both
tangents so: on curves from k = 6 on (Σ sin(2πj/k) q_j), at corners from k = 3 on (Σ sin(πj/k) q_j).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float, Int

from pns_common.connectivity.topology import Topology, sharp_edge_count
from pns_common.masks.limit.sectors import Sectors
from pns_common.masks.stencils import EDGE_ENDPOINT, EDGE_OPPOSITE, MIDPOINT, loop_beta

# From so many spokes on the even mask of a dart has one form.
MANY = 9
# Below so many it is kept: to find it takes milliseconds, and few meshes have darts of more.
KEPT = 64


@dataclass(frozen=True, eq=False)
class TangentMasks:
    """Weights of both tangents (the last axis).

    Attributes:
        leaving: of a corner's next vertex in its face: q_j of the j-th corner.
        arriving: of the vertex before it, q_{j+1}; 0 but at the last corner of open sectors.
        centre: of p, for each sector.
    """

    leaving: Float[np.ndarray, "C 2"]
    arriving: Float[np.ndarray, "C 2"]
    centre: Float[np.ndarray, "S 2"]


def tangent_masks(topology: Topology, around: Sectors) -> TangentMasks:
    """Return the masks of all sectors."""
    sharp = sharp_edge_count(topology)[around.vertex]
    size = around.size
    rank, k = around.rank, size[around.of_corner]
    leaving = np.zeros((len(rank), 2))
    arriving = np.zeros((len(rank), 2))
    centre = np.zeros((len(size), 2))
    first = rank == 0

    closed = around.closed[around.of_corner]
    angle = 2 * np.pi * rank / k
    # Of two corners, those of a fold, sin(π) in floats would be a direction made of rounding.
    across = np.where(k == 2, 0.0, np.sin(angle))
    leaving[closed] = np.stack([np.cos(angle), across], axis=-1)[closed]

    is_curve = ~around.closed & (sharp == 2)
    curve = is_curve[around.of_corner]
    end, middle = _curve_weights(size)
    centre[is_curve, 1] = middle[is_curve]
    leaving[curve, 0] = first[curve]
    across = np.where(first, end[around.of_corner], np.sin(np.pi * rank / k))
    leaving[curve, 1] = across[curve]
    ends = curve & around.last
    arriving[ends, 0], arriving[ends, 1] = -1, end[around.of_corner][ends]

    is_corner = ~around.closed & (sharp > 2)
    corner = is_corner[around.of_corner]
    centre[is_corner] = -1
    leaving[corner, 0] = first[corner]
    arriving[corner & around.last, 1] = 1

    is_dart = ~around.closed & (sharp == 1)
    for valence, rows in _by_size(np.flatnonzero(is_dart[around.of_corner]), k):
        even, odd = dart_tangents(valence)
        centre[around.of_corner[rows]] = even[0], 0.0
        leaving[rows, 0], leaving[rows, 1] = even[1:][rank[rows]], odd[rank[rows]]
    return TangentMasks(leaving, arriving, centre)


def _by_size(
    rows: Int[np.ndarray, " N"], size: Int[np.ndarray, " C"]
) -> Iterator[tuple[int, Int[np.ndarray, " M"]]]:
    """Yield the rows of each size that occurs among them."""
    rows = rows[np.argsort(size[rows], kind="stable")]
    sizes, starts = np.unique(size[rows], return_index=True)
    yield from zip(sizes.tolist(), np.split(rows, starts)[1:], strict=True)


def _curve_weights(
    size: np.ndarray,
) -> tuple[Float[np.ndarray, " S"], Float[np.ndarray, " S"]]:
    """Return a and c of the mask across a curve."""
    k = size.astype(float)
    step = np.pi / k
    total = np.where(size > 1, 1 / np.tan(step / 2), 0.0)
    end = (np.sin(step) - total) / (8 * (EDGE_ENDPOINT + np.cos(step) / 4) - 2)
    end = np.where(size > 1, end, 0.5)
    return end, np.where(size > 1, -total - 2 * end, -1.0)


def dart_tangents(valence: int) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " K"]]:
    """Return the even mask (centre first) and the odd one (neighbours alone), the crease at q_0."""
    angle = 2 * np.pi * np.arange(valence) / valence
    even = _kept_even(valence) if valence < KEPT else _even(valence)
    odd = np.sin(angle) if valence > 2 else np.zeros(valence)
    return even * np.sign(even[1:] @ np.cos(angle)), odd


@cache
def _kept_even(k: int) -> Float[np.ndarray, " N"]:
    return _even(k)


def _even(k: int) -> Float[np.ndarray, " N"]:
    """Return the second left eigenvector of a dart's matrix among those that are even."""
    return _even_of_few(k) if k < MANY else _even_of_many(k)


def _even_of_few(k: int) -> Float[np.ndarray, " N"]:
    """Return the same from the matrix of fewer than ``MANY`` spokes."""
    beta = float(loop_beta(np.array([k]))[0])
    matrix = np.zeros((k + 1, k + 1))
    matrix[0, 0], matrix[0, 1:] = 1 - k * beta, beta
    matrix[1, :2] = MIDPOINT
    for j in range(1, k):
        matrix[1 + j, 0] = matrix[1 + j, 1 + j] = EDGE_ENDPOINT
        for beside in (j - 1, j + 1):
            matrix[1 + j, 1 + beside % k] += EDGE_OPPOSITE
    # Orthonormal coordinates of what reads the same both ways round.
    fold = np.zeros((k // 2 + 2, k + 1))
    fold[0, 0] = 1
    for j in range(k):
        fold[1 + min(j, k - j), 1 + j] = 1
    fold /= np.linalg.norm(fold, axis=1, keepdims=True)
    values, vectors = np.linalg.eig(fold @ matrix.T @ fold.T)
    second = np.argsort(-np.real(values))[1]
    return fold.T @ np.real(vectors[:, second])


def _even_of_many(k: int) -> Float[np.ndarray, " N"]:
    """Return the same for ``MANY`` spokes and more: a matrix of thousands would be too large.

    With weight 1 of p, λ = 3/8 + cos(θ)/4 and t = k θ/2, columns 0 < j < k say
    w_j = c (1 − cos(θ (j − k/2)) / cos t), c = 4 β / (cos θ − 1); that of q_0 says
    (λ − 1/2) w_0 = β + w_1 / 4; and p's own, (λ − 1 + k β) = w_0 / 2 + 3/8 Σ w_j, is left to be
    solved for t. Its second root lies between π and 3π/2, alone.
    """
    low, high = np.pi, 3 * np.pi / 2
    while low < (middle := (low + high) / 2) < high:
        _, missing = _even_at(middle, k)
        low, high = (middle, high) if missing > 0 else (low, middle)
    weights, _ = _even_at(low, k)
    return weights / np.linalg.norm(weights)


def _even_at(t: float, k: int) -> tuple[Float[np.ndarray, " N"], float]:
    """Return the weights at a t, and by how much p's own column is missed."""
    beta, theta = float(loop_beta(np.array([k]))[0]), 2 * t / k
    rate = EDGE_ENDPOINT + np.cos(theta) / 4
    c = -2 * beta / np.sin(theta / 2) ** 2
    inner = c * (1 - np.cos(theta * (np.arange(1, k) - k / 2)) / np.cos(t))
    at_crease = (beta + inner[0] / 4) / (rate - MIDPOINT)
    missing = rate - 1 + k * beta - at_crease / 2 - EDGE_ENDPOINT * inner.sum()
    return np.concatenate([[1.0, at_crease], inner]), float(missing)
