"""The limit masks of vertices on exactly one sharp edge, solved for spoke by spoke.

A dart p moves by Loop's smooth rule, and so do the edge vertices of its spokes, but for the sharp
one, whose vertex is the middle. The limit mask is the left eigenvector of that matrix for its
eigenvalue 1. With weight 1 of p, spokes j have

    w_j = β + 3/8 w_j + 1/8 Σ w_i      smooth; i: smooth spokes on a face with p and j
    w_s = β + 1/2 w_s + 1/8 Σ w_i      sharp

so w_j = (8 β + Σ w_i) / 5: each round of that leaves 2/5 of what is missing, since a spoke has two
faces at most. All terms are positive, so no weight is below 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.connectivity.topology import EdgeClass, Topology, sharp_edge_count
from pns_common.masks.stencils import EDGE_ENDPOINT, EDGE_OPPOSITE, MIDPOINT, loop_beta

# (2/5)^45 is 10⁻¹⁸.
ROUNDS = 45


@dataclass(frozen=True, eq=False)
class DartMasks:
    """Masks of D darts that have S spokes in all, dart after dart.

    Attributes:
        vertices: the darts.
        centre: their own weights.
        spokes: 2 e or 2 e + 1 for edge e, by which end the dart is.
        of_dart: which dart each spoke is of.
        weights: of what lies at the far ends.
    """

    vertices: Int[np.ndarray, " D"]
    centre: Float[np.ndarray, " D"]
    spokes: Int[np.ndarray, " S"]
    of_dart: Int[np.ndarray, " S"]
    weights: Float[np.ndarray, " S"]


def dart_masks(topology: Topology) -> DartMasks:
    """Return the masks of all darts, whatever faces there are around them."""
    vertices = np.flatnonzero(sharp_edge_count(topology) == 1)
    number = np.full(topology.vertex_count, -1)
    number[vertices] = np.arange(len(vertices))
    ends = topology.edges.reshape(-1)
    spokes = np.flatnonzero(number[ends] >= 0)
    spokes = spokes[np.argsort(ends[spokes], kind="stable")]
    of_dart = number[ends[spokes]]

    beta = loop_beta(topology.valence[vertices])[of_dart]
    smooth = topology.edge_class[spokes // 2] == EdgeClass.INTERIOR
    beside = _beside(topology, spokes, smooth)
    weights = np.zeros(len(spokes) + 1)  # the last is nobody's
    for _ in range(ROUNDS):
        around = EDGE_OPPOSITE * (weights[beside[:, 0]] + weights[beside[:, 1]])
        weights[:-1][smooth] = (beta[smooth] + around) / (1 - EDGE_ENDPOINT)
    at_sharp = np.bincount(
        beside.reshape(-1), np.repeat(weights[:-1][smooth], 2), minlength=len(weights)
    )[:-1]
    sharp = (beta + EDGE_OPPOSITE * at_sharp) / (1 - MIDPOINT)
    weights = np.where(smooth, weights[:-1], sharp)
    total = 1 + np.bincount(of_dart, weights, minlength=len(vertices))
    return DartMasks(vertices, 1 / total, spokes, of_dart, weights / total[of_dart])


def _beside(
    topology: Topology, spokes: Int[np.ndarray, " S"], smooth: np.ndarray
) -> Int[np.ndarray, "N 2"]:
    """Return for each smooth spoke which two share a face with it; S where there is none."""
    count = topology.vertex_count
    near = topology.edges.reshape(-1)[spokes]
    keys = near * count + topology.edges[:, ::-1].reshape(-1)[spokes]
    order = np.argsort(keys, kind="stable")
    asked = near[smooth][:, None] * count + topology.stencil[spokes[smooth] // 2, 2:]
    place = np.searchsorted(keys, asked, sorter=order)
    found = order[np.minimum(place, len(spokes) - 1)]
    return np.where(keys[found] == asked, found, len(spokes))
