"""Sums over the ring of a vertex: they know no first neighbour.

The mean normal is smooth where the ring has area, and no normalised sum of tangents.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, beside, cross, gather, namespace, norm, segment_sum
from pns_common.connectivity.topology import Topology


def mean_normals(points: Float[Array, "V 3"], faces: Int[np.ndarray, "F 3"]) -> Float[Array, "V 3"]:
    """Return m_v = Σ (b − a) × (c − a) / Σ ‖(b − a) × (c − a)‖ over v's faces; 0 without area.

    The mean of their normals, weighted by area: ‖m_v‖ ≤ 1, and 1 where they agree.
    """
    a, b, c = (gather(points, faces[:, corner]) for corner in range(3))
    vectors = cross(b - a, c - a)
    corners, repeated = faces.reshape(-1), np.repeat(np.arange(len(faces)), 3)
    count = points.shape[0]
    total = segment_sum(gather(vectors, repeated), corners, count)
    area = segment_sum(gather(norm(vectors)[:, None], repeated), corners, count)
    return divided(total, area)


def spokes(points: Float[Array, "V 3"], topology: Topology) -> Float[Array, "S 3"]:
    """Return p_j − p_v along every edge both ways: rows 2 e and 2 e + 1 start at its two ends."""
    ends = topology.edges.reshape(-1)
    others = topology.edges[:, ::-1].reshape(-1)
    return gather(points, others) - gather(points, ends)


def neighbour_mean(values: Float[Array, "S K"], topology: Topology) -> Float[Array, "V K"]:
    """Return the mean of the spokes' values at each vertex; 0 where there are none."""
    valence = np.maximum(topology.valence, 1)
    total = segment_sum(values, topology.edges.reshape(-1), topology.vertex_count)
    return total / beside(values, valence, values.dtype)[:, None]


def divided(values: Float[Array, "N K"], by: Float[Array, "N 1"]) -> Float[Array, "N K"]:
    """Return ``values`` / ``by``, and 0 where ``by`` is 0."""
    xp = namespace(values)
    positive = by > 0
    return xp.where(positive, values / xp.where(positive, by, 1.0), 0.0)
