"""Loop's limit surface at the vertices of a mesh: exact positions and normals.

A limit mask is a left eigenvector of the local subdivision matrix for its eigenvalue 1. By the
number of sharp edges (boundary, irregular, crease) at a vertex:

    none       (1 − w_k) p + w_k (mean of the neighbours)      w_k of ``limit_ring_weight``
    one        (a dart) p + Σ w_j q_j, over 1 + Σ w_j
               smooth spokes: w_j = β_k + 3/8 w_j + 1/8 (those beside it, but for the sharp one)
               the sharp one: w_s = β_k + 1/2 w_s + 1/8 (both beside it)
    two        (4 p + the two neighbours along the curve) / 6
    more       p, which never moves

All weights are ≥ 0 and sum to 1, so two control meshes that are ε apart have limits within ε.
Soft edges blend the rules as they do in refinement. For normals they count as smooth.

Tangent masks are left eigenvectors for the subdominant eigenvalues; their cross product is the
normal. With q_0 … q_k the neighbours of p in a sector of k faces, anticlockwise:

    closed     Σ cos(2πj/k) q_j  and  Σ sin(2πj/k) q_j
    curve      q_0 − q_k  and  c p + a (q_0 + q_k) + Σ sin(πj/k) q_j                      0 < j < k
               a = (sin(π/k) − S) / (8 λ − 2), c = −S − 2 a, S = Σ sin(πj/k),
               λ = 3/8 + cos(π/k) / 4; for k = 1 the second difference, a = 1/2, c = −1
    corner     q_0 − p  and  q_k − p
    dart       Σ sin(2πj/k) q_j and the even eigenvector, of which one number is solved for

At k = 3 the curve's are the masks of Hoppe et al. 1994 for a regular crease; elsewhere theirs
belong to their own rules next to creases, which are not the ones used here. Where another mode
shrinks no faster than these, Loop's surface has no tangent plane, and we call the plane of both
tangents so: on curves from k = 6 on (Σ sin(2πj/k) q_j), at corners from k = 3 on (Σ sin(πj/k) q_j).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Integer

from pns_common.kernels import loop as masks
from pns_common.mesh.rows import ranges
from pns_common.mesh.sectors import find_sectors
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import CURVE_LIMIT, WIDTH, follow_curves
from pns_common.schemes.loop_weights import beta, limit_ring_weight
from pns_common.schemes.sector_masks import (
    CLOSED,
    CURVE,
    DART,
    LimitNormals,
    mask_tables,
    sector_normals,
)

# Of a dart's smooth spokes, in units of β: far from the sharp edge, and how that decays towards it.
FAR_WEIGHT, DECAY = 8 / 3, (5 - 21**0.5) / 2
# From so many spokes on the even mask of a dart has one form.
MANY = 9


def limit_normals(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> LimitNormals:
    """Return the normals of the limit surface at the limits of the vertices."""
    return sector_normals(points, topology, tangent_mask, blocks)


# --- positions ------------------------------------------------------------------------------------


def limit_positions(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "V 3"]:
    """Return the limits of three columns."""
    count = topology.vertex_count
    limits, valence = np.empty((count, WIDTH)), np.empty(count, dtype=np.int32)
    ring = points, topology.edges, topology.edge_reach, limits, valence
    blocks.owners(count).run(count, masks.sum_rings, *ring)
    valences = np.arange(int(valence.max(initial=0)) + 1)
    weight = limit_ring_weight(valences) / np.maximum(valences, 1)
    blocks.run(count, masks.blend_rings, points, valence, weight, limits)
    darts = np.flatnonzero(topology.sharp_count == DART)
    if len(darts):
        limits[darts] = _dart_limits(points, topology, darts, beta(valence[darts])[:, None])
    follow_curves(points, topology, CURVE_LIMIT, limits)
    return limits


def _dart_limits(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    darts: Integer[np.ndarray, " D"],
    beta_of_darts: Float[np.ndarray, "D 1"],
) -> Float[np.ndarray, "D 3"]:
    """Return the limits of the vertices on exactly one sharp edge."""
    around, sums = find_sectors(topology.connectivity), np.zeros((topology.vertex_count, WIDTH))
    total = np.zeros(topology.vertex_count)
    assert topology.sharpest is not None
    # The sharp edge: 2 (β + an eighth of both spokes beside it); that eighth is in the tables.
    sums[darts] = 2 * (points[topology.sharpest.neighbours[darts, 0]] - points[darts])
    total[darts] = 2
    rows = np.flatnonzero(topology.sharp_count[around.vertex] == DART)
    size = around.size[rows]
    at, tables = mask_tables(dart_weights, rows < around.opened, size)
    p, q = np.repeat(around.vertex[rows], size), around.spokes[ranges(around.starts[rows], size)]
    weights = tables[ranges(at, size)]
    np.add.at(total, p, weights)
    np.add.at(sums, p, weights[:, None] * (points[q] - points[p]))
    scale = beta_of_darts / (1 + beta_of_darts * total[darts, None])
    return points[darts] + scale * sums[darts]


def dart_weights(opened: int, k: int) -> Float[np.ndarray, " K"]:
    """Return a dart's weights of q_0 … q_{k−1} in a sector, in units of β.

    They solve 5 w_j = 8 + w_{j−1} + w_{j+1}, with 0 at both ends if the sector is open. In place of
    w_0 stands the share that w_1 and w_{k−1} add to the sharp edge's weight.
    """
    if not opened:
        return np.full(k, FAR_WEIGHT)
    j = np.arange(k + 1)
    weights = FAR_WEIGHT * (1 - (DECAY**j + DECAY ** (k - j)) / (1 + DECAY**k))
    weights[0] = weights[1] / 2
    return weights[:k]


# --- tangents -------------------------------------------------------------------------------------


def tangent_mask(kind: int, k: int) -> Float[np.ndarray, "K1 2"]:
    """Return the weights of q_0 … q_k, less p, in both tangents of a sector of k faces.

    All weights sum to 0 with the centre's, so p has none.
    """
    mask = np.zeros((k + 1, 2))
    if kind == CLOSED:
        angle = 2 * np.pi * np.arange(k) / k
        mask[:k, 0] = np.cos(angle)
        # Of two corners, those of a fold, sin(π) in floats would be a direction made of rounding.
        mask[:k, 1] = np.sin(angle) if k != 2 else 0.0
    elif kind == DART:
        even, odd = dart_tangents(k)
        mask[:k, 0], mask[:k, 1] = even[1:], odd
    elif kind == CURVE:
        mask[0, 0], mask[k, 0] = 1, -1
        mask[1:k, 1] = np.sin(np.pi * np.arange(1, k) / k)
        total = 1 / np.tan(np.pi / k / 2) if k > 1 else 0.0
        rate = masks.EDGE_ENDPOINT + np.cos(np.pi / k) / 4
        mask[[0, k], 1] = (np.sin(np.pi / k) - total) / (8 * rate - 2) if k > 1 else 1 / 2
    else:
        mask[0, 0], mask[k, 1] = 1, 1
    return mask


def dart_tangents(valence: int) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " K"]]:
    """Return the even mask (centre first) and the odd one (neighbours alone), the crease at q_0."""
    angle, even = 2 * np.pi * np.arange(valence) / valence, _even(valence)
    odd = np.sin(angle) if valence > 2 else np.zeros(valence)
    return even * np.sign(even[1:] @ np.cos(angle)), odd


@lru_cache(maxsize=64)
def _even(k: int) -> Float[np.ndarray, " N"]:
    """Return the second even left eigenvector of a dart's matrix; finding it takes milliseconds."""
    return _even_of_few(k) if k < MANY else _even_of_many(k)


def _even_of_few(k: int) -> Float[np.ndarray, " N"]:
    """Return that eigenvector for fewer than MANY spokes, from the matrix."""
    weight = float(beta(np.array([k]))[0])
    matrix = np.zeros((k + 1, k + 1))
    matrix[0, 0], matrix[0, 1:] = 1 - k * weight, weight
    matrix[1, :2] = masks.MIDPOINT
    for j in range(1, k):
        matrix[1 + j, 0] = matrix[1 + j, 1 + j] = masks.EDGE_ENDPOINT
        for beside in (j - 1, j + 1):
            matrix[1 + j, 1 + beside % k] += masks.EDGE_OPPOSITE
    # Orthonormal coordinates of what reads alike both ways round.
    fold = np.zeros((k // 2 + 2, k + 1))
    fold[0, 0] = 1
    for j in range(k):
        fold[1 + min(j, k - j), 1 + j] = 1
    fold /= np.linalg.norm(fold, axis=1, keepdims=True)
    values, vectors = np.linalg.eig(fold @ matrix.T @ fold.T)
    second = np.argsort(-np.real(values))[1]
    return fold.T @ np.real(vectors[:, second])


def _even_of_many(k: int) -> Float[np.ndarray, " N"]:
    """Return that eigenvector for MANY spokes and more: the matrix may be too large.

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
    weight, theta = float(beta(np.array([k]))[0]), 2 * t / k
    rate = masks.EDGE_ENDPOINT + np.cos(theta) / 4
    c = -2 * weight / np.sin(theta / 2) ** 2
    inner = c * (1 - np.cos(theta * (np.arange(1, k) - k / 2)) / np.cos(t))
    at_crease = (weight + inner[0] / 4) / (rate - masks.MIDPOINT)
    missing = rate - 1 + k * weight - at_crease / 2 - masks.EDGE_ENDPOINT * inner.sum()
    return np.concatenate([[1.0, at_crease], inner]), float(missing)
