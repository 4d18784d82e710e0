"""Loop's masks (Loop 1987; the paper's equations 2 and 3), each weight named once."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, beside, gather, namespace, segment_sum
from pns_common.connectivity.topology import EdgeClass, Topology, sharp_edge_count

EDGE_ENDPOINT, EDGE_OPPOSITE = 3 / 8, 1 / 8
MIDPOINT = 1 / 2
CURVE_CENTRE, CURVE_NEIGHBOUR = 3 / 4, 1 / 8
# The limit of a vertex on a cubic B-spline.
CURVE_LIMIT_CENTRE, CURVE_LIMIT_NEIGHBOUR = 4 / 6, 1 / 6

ALL = slice(None)


def loop_beta(valence: Int[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return β_k = (5/8 − (3/8 + ¼ cos 2π/k)²) / k, the weight of one neighbour; 0 for valence 0.

    This is Loop's own cosine formula. Warren's 3/(8k) agrees only at k = 3 and k = 6.
    """
    k = np.maximum(valence, 1)
    beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
    return np.where(valence > 0, beta, 0.0)


def loop_ring_weight(valence: Int[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return k β_k, the weight of the neighbours' mean in Loop's vertex mask."""
    return valence * loop_beta(valence)


def limit_ring_weight(valence: Int[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return w_k = 1 / (1 + 3 / (8 k β_k)), the ring's weight in Loop's limit mask; 0 for k = 0.

    The limit of a vertex is (1 − w_k) p + w_k (mean of its neighbours).
    """
    ring = loop_ring_weight(valence)
    return ring / (ring + 3 / 8)


def loop_edge_point(
    a: Float[Array, "N K"], b: Float[Array, "N K"], c: Float[Array, "N K"], d: Float[Array, "N K"]
) -> Float[Array, "N K"]:
    """Return q0 = 3/8 (a + b) + 1/8 (c + d), the edge vertex of interior edges (equation 2)."""
    return EDGE_ENDPOINT * (a + b) + EDGE_OPPOSITE * (c + d)


def loop_edge_vertices(
    points: Float[Array, "V K"], topology: Topology, rows: slice = ALL
) -> Float[Array, "E K"]:
    """Return a vertex for each edge (of ``rows``): Loop's if interior, else the midpoint."""
    xp = namespace(points)
    stencil = topology.stencil[rows]
    a, b, c, d = (stencil[:, column] for column in range(4))
    # A missing opposite (−1) is read as the endpoint a and its result thrown away.
    c, d = np.where(c < 0, a, c), np.where(d < 0, a, d)
    pa, pb = gather(points, a), gather(points, b)
    interior = beside(points, topology.edge_class[rows] == EdgeClass.INTERIOR)
    return xp.where(
        interior[:, None],
        loop_edge_point(pa, pb, gather(points, c), gather(points, d)),
        MIDPOINT * (pa + pb),
    )


def loop_vertex_vertices(points: Float[Array, "V K"], topology: Topology) -> Float[Array, "V K"]:
    """Return the moved old vertices.

    Counting boundary, irregular and crease edges at a vertex: none or one (a dart), Loop's rule
    (equation 3); two, the cubic curve rule 1/8, 3/4, 1/8 along them; more, it stays. An isolated
    vertex stays. For creases these are the rules of Hoppe et al. 1994 (smooth, dart, crease,
    corner).
    """
    xp = namespace(points)
    sharp_edges = topology.edges[topology.edge_class != EdgeClass.INTERIOR]
    sharp = sharp_edge_count(topology)
    valence = topology.valence
    ring_sum = _neighbour_sum(points, topology.edges)

    smooth = sharp < 2
    beta = np.where(smooth, loop_beta(valence), np.where(sharp == 2, CURVE_NEIGHBOUR, 0.0))
    centre = np.where(smooth, 1 - valence * beta, np.where(sharp == 2, CURVE_CENTRE, 1.0))
    on_curve = beside(points, ~smooth)[:, None]
    neighbours = ring_sum
    if len(sharp_edges):
        neighbours = xp.where(on_curve, _neighbour_sum(points, sharp_edges), ring_sum)
    beta, centre = (beside(points, weight, points.dtype) for weight in (beta, centre))
    return centre[:, None] * points + beta[:, None] * neighbours


def _neighbour_sum(
    points: Float[Array, "V K"], edges: Int[np.ndarray, "E 2"]
) -> Float[Array, "V K"]:
    """Return for each vertex the sum of its neighbours along ``edges``."""
    neighbours = gather(points, edges[:, ::-1].reshape(-1))
    return segment_sum(neighbours, edges.reshape(-1), points.shape[0])
