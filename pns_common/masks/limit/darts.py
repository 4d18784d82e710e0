"""The limit mask of a vertex on exactly one sharp edge, from its own subdivision matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.connectivity.topology import EdgeClass, Topology, sharp_edge_count
from pns_common.masks.stencils import EDGE_ENDPOINT, EDGE_OPPOSITE, MIDPOINT, loop_beta


@dataclass(frozen=True, eq=False)
class DartMasks:
    """Masks of D darts that have N spokes each.

    Attributes:
        vertices: the darts.
        spokes: 2 e or 2 e + 1 for edge e, by which end the dart is.
        weights: of the dart, then of what lies at the far ends.
    """

    vertices: Int[np.ndarray, " D"]
    spokes: Int[np.ndarray, "D N"]
    weights: Float[np.ndarray, "D M"]


def dart_masks(topology: Topology) -> list[DartMasks]:
    """Return the masks of all darts, by valence.

    A dart's matrix is built from the edges around it, whatever faces there are; its stationary
    distribution is the mask, so no weight is below 0 and they sum to 1.
    """
    is_dart = sharp_edge_count(topology) == 1
    spokes = np.flatnonzero(is_dart[topology.edges.reshape(-1)])
    ends = topology.edges.reshape(-1)[spokes]
    order = np.argsort(ends, kind="stable")
    spokes, ends = spokes[order], ends[order]
    masks: list[DartMasks] = []
    for valence in np.unique(topology.valence[is_dart]):
        rows = topology.valence[ends] == valence
        # Spokes are in the order of their ends, so each dart has a run of them.
        around, vertices = spokes[rows].reshape(-1, valence), ends[rows][::valence]
        # ℓ A = ℓ, Σ ℓ = 1: one equation of the first is replaced by the second.
        system = np.swapaxes(_matrices(topology, around), 1, 2) - np.eye(valence + 1)
        system[:, 0, :] = 1
        right = np.zeros((len(vertices), valence + 1, 1))
        right[:, 0] = 1
        weights = np.maximum(np.linalg.solve(system, right)[:, :, 0], 0.0)
        masks.append(DartMasks(vertices, around, weights / weights.sum(axis=1, keepdims=True)))
    return masks


def _matrices(topology: Topology, spokes: Int[np.ndarray, "D N"]) -> Float[np.ndarray, "D M M"]:
    """Return how darts and their neighbours move; the dart comes first."""
    count, valence = spokes.shape
    edges, ring = spokes // 2, topology.edges[:, ::-1].reshape(-1)[spokes]
    beta = float(loop_beta(np.array([valence]))[0])
    matrix = np.zeros((count, valence + 1, valence + 1))
    matrix[:, 0, 0], matrix[:, 0, 1:] = 1 - valence * beta, beta
    interior = topology.edge_class[edges] == EdgeClass.INTERIOR
    place = np.arange(1, valence + 1, dtype=np.int64)
    matrix[:, 1:, 0] = np.where(interior, EDGE_ENDPOINT, MIDPOINT)
    matrix[:, place, place] = np.where(interior, EDGE_ENDPOINT, MIDPOINT)
    for side in (2, 3):
        opposite = topology.stencil[edges, side]
        among = opposite[:, :, None] == ring[:, None, :]
        matrix[:, 1:, 1:] += EDGE_OPPOSITE * (among & interior[:, :, None])
    return matrix
