"""Catmull–Clark's limit surface at the vertices of a mesh: exact positions and normals.

All masks read the next mesh, which has quads alone: p' the vertex, e_j its neighbours there and d_j
the opposite corners of its quads. Where a mesh has quads alone, they are the masks on that mesh
too. By the number of sharp edges at a vertex of k corners:

    none       (k² p' + 4 Σ e_j + Σ d_j) / (k (k + 5))           Halstead, Kass and DeRose 1993
    one        (a dart) k² p' + Σ w_j e_j + Σ v_j d_j, over the sum of the weights
               smooth neighbours: 7 w_j = 20 + w_{j−1} + w_{j+1}, where the sharp one counts as 0
               opposite corners: v_j = (1 + (w_j + w_{j+1}) / 4) / 3, alike
               the sharp one: 2 + 2 Σ v_j of both quads beside it
    two        (4 p + the two neighbours along the curve) / 6
    more       p, which never moves

All weights are ≥ 0 and sum to 1. Soft edges blend the rules as they do in refinement; for normals
they count as smooth.

Tangent masks are left eigenvectors for the subdominant eigenvalues λ; their cross product is the
normal. In a sector of k quads, θ = π/k on a curve and 2π/k in a closed fan:

    λ          (5 + cos θ + cos(θ/2) √(18 + 2 cos θ)) / 16
    closed     A cos(jθ) e_j + (cos(jθ) + cos((j + 1)θ)) d_j, and with sines; A = 4 (4 λ − 1)
    curve      e_0 − e_k, and sin(jθ) at e_j, (sin(jθ) + sin((j + 1)θ)) / A at d_j,
               (λ v_0 − T/8) / (λ − 1/4) at both ends, T the sum of all the others
    corner     e_0 − p  and  e_k − p
    dart       Σ sin(jθ) e_j and its d_j, and the even eigenvector, of which λ is solved for

Where another mode shrinks no faster there is no tangent plane, and the plane of both is called so.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from pns_common.kernels import catmull_clark as kernels
from pns_common.mesh.rows import ranges
from pns_common.mesh.sectors import find_sectors
from pns_common.mesh.topology import NO_WEIGHTS, Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import CURVE_LIMIT, WIDTH, follow_curves
from pns_common.schemes.catmull_clark_masks import place
from pns_common.schemes.sector_masks import (
    CLOSED,
    CURVE,
    DART,
    LimitNormals,
    mask_tables,
    sector_normals,
)

# A neighbour's weight, in units of an opposite corner's.
EDGE = 4
# Of a dart's smooth neighbours: far from the sharp edge, and how that decays towards it.
FAR_WEIGHT, DECAY = 4.0, (7 - 45**0.5) / 2
# From so many spokes on the even mask of a dart has one form.
MANY = 5


def eigenvalue(theta: float) -> float:
    """Return λ of the mode that turns by ``theta`` from one spoke to the next."""
    cosine = np.cos(theta)
    return (5 + cosine + np.cos(theta / 2) * np.sqrt(18 + 2 * cosine)) / 16


def limit_positions(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "V 3"]:
    """Return the limits of three columns."""
    mesh, count = topology, topology.vertex_count
    none = dict.fromkeys(("soft", "vertex_sharpness", "soft_corners"), NO_WEIGHTS)
    smooth = replace(mesh, **none)
    placed, edge_count = place(points, smooth, blocks), len(mesh.edges)
    vertices, edges, faces = np.split(placed, [count, count + edge_count])
    sums, counts = np.empty((count, WIDTH)), np.empty(count, dtype=np.int32)
    around = edges, faces, mesh.connectivity, mesh.corner_reach, True, EDGE / 2
    blocks.owners(count).run(count, kernels.sum_corners, *around, sums, counts)
    k = counts[:, None].astype(np.float64)
    limits = (k * k * vertices + sums) / np.maximum(k * (k + 5), 1)
    few = counts < kernels.LEAST_CORNERS
    limits[few] = vertices[few]
    # Without an edge of sharpness 1 nothing is counted.
    darts = np.flatnonzero(mesh.sharp_count == DART)
    darts = darts[~few[darts]]
    if len(darts):
        limits[darts] = _dart_limits(placed, k[:, 0] ** 2, mesh)[darts]
    follow_curves(points, topology, CURVE_LIMIT, limits)
    return limits


def _dart_limits(
    placed: Float[np.ndarray, "W 3"], weight: Float[np.ndarray, " V"], topology: Topology
) -> Float[np.ndarray, "V 3"]:
    """Return limits, right at vertices on exactly one sharp edge; ``weight`` is k²."""
    around, count = find_sectors(topology.connectivity, quads=True), topology.vertex_count
    total, sums = weight.copy(), weight[:, None] * placed[:count]
    rows = np.flatnonzero(topology.sharp_count[around.vertex] == DART)
    size = around.size[rows]
    at, tables = mask_tables(dart_weights, rows < around.opened, size)
    p, at = np.repeat(around.vertex[rows], size), ranges(at, size, 2)
    spokes = around.spokes[ranges(around.starts[rows], size, 2)[:, None] + np.arange(3)]
    # e_j, d_j, and e_k at the last corner.
    weights = tables[at[:, None] + np.arange(3)]
    weights[np.delete(np.arange(len(at)), np.cumsum(size) - 1), 2] = 0.0
    np.add.at(total, p, weights[:, 0] + weights[:, 1] + weights[:, 2])
    e, d, last = (weights[:, k, None] * placed[spokes[:, k]] for k in range(3))
    np.add.at(sums, p, e + d + last)
    return sums / np.maximum(total, 1)[:, None]


def dart_weights(opened: int, k: int) -> Float[np.ndarray, " N"]:
    """Return a dart's weights of e_0, d_0, e_1, …, e_k in a sector, where p has k².

    An open sector has a sharp edge at both ends, a closed one has none.
    """
    j = np.arange(k + 1)
    ends = np.full(k + 1, FAR_WEIGHT)
    if opened:
        ends = FAR_WEIGHT * (1 - (DECAY**j + DECAY ** (k - j)) / (1 + DECAY**k))
        ends[[0, k]] = 0.0
    opposite = (1 + (ends[1:] + ends[:-1]) / 4) / 3
    if opened:
        ends[0] += 1 + 2 * opposite[0]
        ends[k] += 1 + 2 * opposite[-1]
    else:
        ends[k] = 0.0
    return _woven(ends, opposite)


def _woven(spokes: Float[np.ndarray, " K1"], diagonals: Float[np.ndarray, " K"]) -> np.ndarray:
    """Return e_0, d_0, e_1, d_1, …, e_k."""
    made = np.empty(2 * len(spokes) - 1)
    made[::2], made[1::2] = spokes, diagonals
    return made


# --- normals --------------------------------------------------------------------------------------


def limit_normals(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> LimitNormals:
    """Return the normals of the limit surface at the limits of the vertices."""
    placed = place(points, topology, blocks)
    return sector_normals(placed, topology, tangent_mask, blocks, quads=True)


def tangent_mask(kind: int, k: int) -> Float[np.ndarray, "N 2"]:
    """Return the weights of e_0, d_0, e_1, …, e_k, less p, in both tangents of k quads."""
    mask = np.zeros((2 * k + 1, 2))
    if kind == CLOSED:
        mask[:, 0], mask[:, 1] = _closed_mode(np.cos, k), _closed_mode(np.sin, k)
    elif kind == DART:
        even, odd = dart_tangents(k)
        mask[:, 0], mask[:, 1] = even[1:], odd
    elif kind == CURVE:
        mask[0, 0], mask[-1, 0], mask[:, 1] = 1, -1, _across(k)
    else:
        mask[0, 0], mask[-1, 1] = 1, 1
    return mask


def _closed_mode(turn: np.ufunc, k: int) -> Float[np.ndarray, " N"]:
    """Return the weights of a closed fan's tangent; e_k, which is e_0, has none."""
    theta = 2 * np.pi / k
    if k == 2:  # both shrink by 1/4: the spokes apart, and the opposite corners
        spokes, diagonals = np.array([[1.0, -1, 0], [0, 0, 0]]), np.array([[0.0, 0], [1, -1]])
        which = 0 if turn is np.cos else 1
        return _woven(spokes[which], diagonals[which])
    values = turn(theta * np.arange(k + 1))
    diagonals = values[1:] + values[:-1]
    spokes = 4 * (4 * eigenvalue(theta) - 1) * values
    spokes[k] = 0.0
    return _woven(spokes, diagonals)


def _across(k: int) -> Float[np.ndarray, " N"]:
    """Return the weights of the tangent across a curve; of one quad, the second difference."""
    if k == 1:
        return np.array([1 / 2, 0, 1 / 2])
    theta = np.pi / k
    rate = eigenvalue(theta)
    spokes = np.sin(theta * np.arange(k + 1))
    spokes[[0, k]] = 0.0
    diagonals = (spokes[1:] + spokes[:-1]) / (4 * (4 * rate - 1))
    others = spokes.sum() + diagonals.sum()
    spokes[[0, k]] = (rate * diagonals[0] - others / 8) / (rate - 1 / 4)
    return _woven(spokes, diagonals)


def dart_tangents(k: int) -> tuple[Float[np.ndarray, " M"], Float[np.ndarray, " N"]]:
    """Return the even mask (p first) and the odd one (without p), the crease at e_0."""
    odd = _closed_mode(np.sin, k)
    even = _even(k)
    return even * np.sign(even[1:] @ _woven(*_cosines(k))), odd


def _cosines(k: int) -> tuple[Float[np.ndarray, " K1"], Float[np.ndarray, " K"]]:
    theta = 2 * np.pi / k
    spokes = np.cos(theta * np.arange(k + 1))
    spokes[k] = 0.0
    return spokes, np.cos(theta * (np.arange(k) + 1 / 2))


@lru_cache(maxsize=64)
def _even(k: int) -> Float[np.ndarray, " M"]:
    """Return the second even left eigenvector of a dart's matrix: p, e_0, d_0, e_1, …, e_k."""
    return _even_of_few(k) if k < MANY else _even_of_many(k)


def _even_of_few(k: int) -> Float[np.ndarray, " M"]:
    """Return that eigenvector for fewer than MANY spokes, from the matrix."""
    j = np.arange(k)
    spoke, diagonal, after = 1 + j, 1 + k + j, 1 + (j + 1) % k
    faces = np.zeros((k, 2 * k + 1))
    for corner in (0, spoke, after, diagonal):
        faces[j, corner] += 1 / 4
    matrix = np.zeros((2 * k + 1, 2 * k + 1))
    matrix[diagonal] = faces
    matrix[spoke] = (faces + np.roll(faces, 1, axis=0)) / 4
    matrix[spoke, 0] += 1 / 4
    matrix[spoke, spoke] += 1 / 4
    matrix[1] = 0.0
    matrix[1, :2] = 1 / 2
    matrix[0] = faces.sum(axis=0) / k**2
    matrix[0, spoke] += 1 / k**2
    matrix[0, 0] += (k - 2) / k
    # Orthonormal coordinates of what reads alike both ways round.
    fold = np.zeros((1 + k // 2 + 1 + (k + 1) // 2, 2 * k + 1))
    fold[0, 0] = 1
    fold[1 + np.minimum(j, k - j), spoke] = 1
    fold[2 + k // 2 + np.minimum(j, k - 1 - j), diagonal] = 1
    fold /= np.linalg.norm(fold, axis=1, keepdims=True)
    values, vectors = np.linalg.eig(fold @ matrix.T @ fold.T)
    found = fold.T @ np.real(vectors[:, np.argsort(-np.real(values))[1]])
    return np.concatenate([found[:1], _woven(np.append(found[spoke], 0.0), found[diagonal])])


def _even_of_many(k: int) -> Float[np.ndarray, " M"]:
    """Return that eigenvector for MANY spokes and more: the matrix may be too large.

    With weight 1 of p, λ of θ and t = k θ/2, columns 0 < j < k say
    w_j = c (1 − cos(θ (j − k/2)) / cos t), c = 2 (1 + 2 μ) / (k² μ (cos θ − 1)), μ = λ / (4 λ − 1);
    those of d_j and e_0 follow, and p's own is left to be solved for t. Its root lies alone between
    π and 3π/2, and below k π/4, where λ is that of the crease itself, 1/2.
    """
    low, high = np.pi, min(3 * np.pi / 2, k * np.pi / 4)
    while low < (middle := (low + high) / 2) < high:
        _, missing = _even_at(middle, k)
        low, high = (middle, high) if missing > 0 else (low, middle)
    weights, _ = _even_at(low, k)
    return weights / np.linalg.norm(weights)


def _even_at(t: float, k: int) -> tuple[Float[np.ndarray, " M"], float]:
    """Return the weights at a t, and by how much p's own column is missed."""
    theta = 2 * t / k
    rate, own = eigenvalue(theta), 1 / k**2
    mu = rate / (4 * rate - 1)
    c = -own * (1 + 2 * mu) / (mu * np.sin(theta / 2) ** 2)
    spokes = np.zeros(k + 1)
    spokes[1:k] = c * (1 - np.cos(theta * (np.arange(1, k) - k / 2)) / np.cos(t))
    diagonals = (own + (spokes[1:] + spokes[:-1]) / 4) / (4 * rate - 1)
    at_crease = (own + 2 * rate * diagonals[0]) / (rate - 1 / 2)
    kept = (k - 2) / k + at_crease / 2 + spokes.sum() / 4 + rate * diagonals.sum()
    spokes[0] = at_crease
    return np.concatenate([[1.0], _woven(spokes, diagonals)]), float(rate - kept)
