"""Loop's remaining levels and its limit masks as sparse matrices.

After the learned levels everything is linear in the points: the limit surface at the vertices of a
finer level, and its two tangents there. So training evaluates it exactly, without a rollout.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pns_common.connectivity.topology import (
    EdgeClass,
    Topology,
    build_topology,
    next_corner,
    sharp_edge_count,
    split,
)
from pns_common.masks.stencils import (
    CURVE_CENTRE,
    CURVE_LIMIT_CENTRE,
    CURVE_LIMIT_NEIGHBOUR,
    CURVE_NEIGHBOUR,
    EDGE_ENDPOINT,
    EDGE_OPPOSITE,
    MIDPOINT,
    limit_ring_weight,
    loop_beta,
)


@dataclass(frozen=True, eq=False)
class LimitMaps:
    """From the points of one level to Loop's limit surface at the vertices of a finer one.

    Attributes:
        position, tangent, cotangent: (M, N) matrices; position × tangent makes the outward normal
            with the cotangent, at smooth vertices alone.
        smooth: whether each of the M vertices has a closed ring; else its tangents are 0.
        topology: of the finer level.
        ancestor: a vertex of the coarser level that belongs to the same mesh.
    """

    position: sparse.csr_array
    tangent: sparse.csr_array
    cotangent: sparse.csr_array
    smooth: Bool[np.ndarray, " M"]
    topology: Topology
    ancestor: Int[np.ndarray, " M"]


def limit_maps(topology: Topology, levels: int) -> LimitMaps:
    """Return the maps from a level's points to the limit at the vertices of `levels` further on."""
    ancestor = np.arange(topology.vertex_count)
    refined = sparse.eye_array(topology.vertex_count, format="csr")
    for _ in range(levels):
        refined = loop_matrix(topology) @ refined
        ancestor = np.concatenate([ancestor, ancestor[topology.edges[:, 0]]])
        topology = build_topology(split(topology), topology.vertex_count + len(topology.edges))
    tangent, cotangent = _tangent_matrices(topology)
    return LimitMaps(
        position=sparse.csr_array(_position_matrix(topology) @ refined),
        tangent=sparse.csr_array(tangent @ refined),
        cotangent=sparse.csr_array(cotangent @ refined),
        smooth=topology.smooth_vertices,
        topology=topology,
        ancestor=ancestor,
    )


def loop_matrix(topology: Topology) -> sparse.csr_array:
    """Return one level of Loop: old vertices first, then edge vertices."""
    count, edges = topology.vertex_count, topology.edges
    valence, sharp = topology.valence, sharp_edge_count(topology)
    neighbour = np.where(sharp < 2, loop_beta(valence), np.where(sharp == 2, CURVE_NEIGHBOUR, 0))
    centre = np.where(sharp < 2, 1 - valence * neighbour, np.where(sharp == 2, CURVE_CENTRE, 1))
    rows, columns, values = [np.arange(count)], [np.arange(count)], [centre]
    for here, there in _neighbours(topology, sharp < 2):
        rows, columns = [*rows, here], [*columns, there]
        values.append(neighbour[here])
    inserted = count + np.arange(len(edges))
    end = np.where(topology.edge_class == EdgeClass.INTERIOR, EDGE_ENDPOINT, MIDPOINT)
    for side in range(2):
        rows, columns = [*rows, inserted], [*columns, edges[:, side]]
        values.append(end)
    for side in (2, 3):
        interior = topology.interior
        rows, columns = [*rows, inserted[interior]], [*columns, topology.stencil[interior, side]]
        values.append(np.full(len(interior), EDGE_OPPOSITE))
    return _matrix(rows, columns, values, (count + len(edges), count))


def applied(matrix: sparse.csr_array, points: Float[Tensor, "N K"]) -> Float[Tensor, "M K"]:
    """Return matrix · points, with a gradient."""
    return _Applied.apply(points, matrix)


class _Applied(torch.autograd.Function):
    """SciPy's product: on one thread a few times as fast as torch's."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, matrix: sparse.csr_array) -> Tensor:
        ctx.matrix = matrix
        return torch.from_numpy(matrix @ points.detach().numpy())

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        back = ctx.matrix.T @ np.ascontiguousarray(gradient.numpy())
        return torch.from_numpy(back), None


def _position_matrix(topology: Topology) -> sparse.csr_array:
    count, valence = topology.vertex_count, topology.valence
    sharp, smooth = sharp_edge_count(topology), topology.smooth_vertices
    pull = limit_ring_weight(valence) * smooth
    curve = sharp == 2
    centre = np.where(smooth, 1 - pull, np.where(curve, CURVE_LIMIT_CENTRE, 1))
    neighbour = np.where(smooth, pull / np.maximum(valence, 1), CURVE_LIMIT_NEIGHBOUR * curve)
    rows, columns, values = [np.arange(count)], [np.arange(count)], [centre]
    for here, there in _neighbours(topology, smooth):
        rows, columns = [*rows, here], [*columns, there]
        values.append(neighbour[here])
    return _matrix(rows, columns, values, (count, count))


def _tangent_matrices(topology: Topology) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Return Σ cos(2πj/k) p_j and Σ sin(2πj/k) p_j round every closed ring, anticlockwise."""
    count, corners = topology.vertex_count, topology.faces.reshape(-1)
    valence = topology.valence
    twin = np.full(len(corners), -1)
    first, second = topology.half_edges[topology.interior].T
    twin[first], twin[second] = second, first
    start = np.full(count, -1)
    start[corners] = np.arange(len(corners))
    centres = np.flatnonzero(topology.smooth_vertices)
    outgoing, active = start[centres], np.arange(len(centres))
    rows, columns, angles = [], [], []
    # Round all rings at once, neighbour by neighbour.
    for turn in range(int(valence[centres].max(initial=0))):
        active = active[valence[centres[active]] > turn]
        here = outgoing[active]
        rows.append(centres[active])
        columns.append(corners[next_corner(here)])
        angles.append(2 * np.pi * turn / valence[centres[active]])
        outgoing[active] = twin[next_corner(next_corner(here))]
    if not rows:
        empty = sparse.csr_array((count, count))
        return empty, empty
    cosine, sine = ([wave(angle) for angle in angles] for wave in (np.cos, np.sin))
    return _matrix(rows, columns, cosine, (count, count)), _matrix(
        rows, columns, sine, (count, count)
    )


def _neighbours(
    topology: Topology, smooth: Bool[np.ndarray, " V"]
) -> list[tuple[Int[np.ndarray, " N"], Int[np.ndarray, " N"]]]:
    """Return who sees whom: smooth vertices all neighbours, others those along sharp edges."""
    interior = topology.edge_class == EdgeClass.INTERIOR
    pairs = []
    for side in range(2):
        here, there = topology.edges[:, side], topology.edges[:, 1 - side]
        seen = smooth[here] | ~interior
        pairs.append((here[seen], there[seen]))
    return pairs


def _matrix(
    rows: list[np.ndarray], columns: list[np.ndarray], values: list[np.ndarray], shape: tuple
) -> sparse.csr_array:
    place = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_array((np.concatenate(values), place), shape=shape)
