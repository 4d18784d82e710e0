"""Loop subdivision of triangle meshes (Loop 1987), with sharp and soft creases.

The whole scheme: where the new vertices of one level go (``place``), how the faces split
(``split``), and where a vertex ends when the rules are applied for ever (``limit``, in
``schemes.loop_limit``).

    edge vertex          3/8 (a + b) + 1/8 (c + d)                       equation 2
    vertex vertex        (1 − k β_k) p + β_k Σ neighbours                equation 3
                         β_k = (5/8 − (3/8 + ¼ cos 2π/k)²) / k
    sharp edge           the midpoint
    on a sharp curve     3/4 p + 1/8 (the two neighbours along it)
    corner               p

Sharp are boundary edges, irregular edges and creases: on none or one of them (a dart) a vertex
follows the smooth rule, on two the curve's, on more it is a corner (Hoppe et al. 1994). Edges of
sharpness w in between blend the rules; see ``kernels.loop.at_sharpness``.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Float

from pns_common.kernels import loop as kernels
from pns_common.mesh.topology import Topology, split_triangles
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import (
    CURVE,
    WIDTH,
    BaseScheme,
    Limit,
    follow_curves,
    in_threes,
)
from pns_common.schemes.loop_limit import limit_normals, limit_positions
from pns_common.schemes.loop_weights import beta

KEPT = 64


def place(
    values: Float[np.ndarray, "V K"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W K"]:
    """Apply Loop's masks to any columns: rows of old vertices first, then of edge vertices."""
    rows = topology.vertex_count + len(topology.edges)
    return in_threes(values, rows, lambda three: _place_three(three, topology, blocks))


def _place_three(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W 3"]:
    count, edge_count = topology.vertex_count, len(topology.edges)
    placed = np.empty((count + edge_count, WIDTH))
    vertices, valence = placed[:count], np.empty(count, dtype=np.int32)
    read = points, topology.connectivity, topology.soft
    blocks.run(edge_count, kernels.place_edges, *read, placed[count:])
    ring = points, topology.edges, topology.edge_reach, vertices, valence
    blocks.owners(count).run(count, kernels.sum_rings, *ring)
    weights = _beta_table(int(valence.max(initial=0)))
    blocks.run(count, kernels.blend_rings, points, valence, weights, vertices)
    follow_curves(points, topology, CURVE, vertices)
    return placed


def _beta_table(largest: int) -> Float[np.ndarray, " K"]:
    """Return β of all valences up to the largest, at least."""
    return _kept_betas() if largest < KEPT else beta(np.arange(largest + 1))


@cache
def _kept_betas() -> Float[np.ndarray, " K"]:
    return beta(np.arange(KEPT))


LIMIT = Limit(limit_positions, limit_normals)
LOOP = BaseScheme("loop", place, split_triangles, limit=LIMIT)
