"""Loop subdivision of triangle meshes (Loop 1987), with sharp and soft creases.

The whole scheme: where the new vertices of one level go (``place``), how the faces split
(``split``), and where a vertex ends when the rules are applied for ever (``limit_weights``; the
limit surface itself is in ``pns_common.limit``).

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

from collections.abc import Callable
from functools import cache

import numpy as np
from jaxtyping import Float, Integer

from pns_common.base_scheme import BaseScheme
from pns_common.kernels import loop as kernels
from pns_common.parallel import Blocks
from pns_common.topology import Topology, split_triangles

KEPT = 64
WIDTH = 3


def beta(valence: Integer[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return β_k, the weight of one neighbour in Loop's own cosine formula; 0 for valence 0."""
    k = np.maximum(valence, 1)
    weight = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
    return np.where(valence > 0, weight, 0.0)


def limit_ring_weight(valence: Integer[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return w_k = 1 / (1 + 3 / (8 k β_k)), the ring's weight in the limit mask; 0 for k = 0.

    The limit of a smooth vertex is (1 − w_k) p + w_k (mean of its neighbours).
    """
    ring = valence * beta(valence)
    return ring / (ring + 3 / 8)


def place(
    values: Float[np.ndarray, "V K"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W K"]:
    """Apply Loop's masks to any columns: rows of old vertices first, then of edge vertices."""
    rows = topology.vertex_count + len(topology.edges)
    return in_threes(values, rows, lambda three: _place_three(three, topology, blocks))


def in_threes(
    values: Float[np.ndarray, "V K"],
    rows: int,
    masks: Callable[[Float[np.ndarray, "V 3"]], Float[np.ndarray, "R 3"]],
) -> Float[np.ndarray, "R K"]:
    """Apply masks, which take three columns and return so many rows, to any number of columns."""
    width = values.shape[1]
    if width == WIDTH:
        return masks(np.ascontiguousarray(values, dtype=np.float64))
    placed = np.empty((rows, width))
    for start in range(0, width, WIDTH):
        given = values[:, start : start + WIDTH]
        three = np.zeros((len(values), WIDTH))
        three[:, : given.shape[1]] = given
        placed[:, start : start + WIDTH] = masks(three)[:, : given.shape[1]]
    return placed


def _place_three(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks
) -> Float[np.ndarray, "W 3"]:
    count, edge_count = topology.vertex_count, len(topology.edges)
    placed = np.empty((count + edge_count, WIDTH))
    read = points, topology.faces, topology.edges, topology.half_edges, topology.edge_class
    blocks.run(
        edge_count,
        lambda begin, end: kernels.place_edges(*read, topology.soft, begin, end, placed[count:]),
    )
    vertices, valence = placed[:count], np.empty(count, dtype=np.int32)
    blocks.owners(count).run(
        count,
        lambda begin, end: kernels.sum_rings(
            points, topology.edges, topology.edge_reach, begin, end, vertices, valence
        ),
    )
    weights = _beta_table(int(valence.max(initial=0)))
    blocks.run(
        count,
        lambda begin, end: kernels.blend_rings(points, valence, weights, begin, end, vertices),
    )
    sharp = topology.sharpest
    if sharp is not None:
        curve = kernels.CURVE_CENTRE, kernels.CURVE_NEIGHBOUR
        kernels.blend_sharp(points, sharp.rows, sharp.weights, sharp.neighbours, *curve, vertices)
    return placed


def _beta_table(largest: int) -> Float[np.ndarray, " K"]:
    """Return β of all valences up to the largest, at least."""
    return _kept_betas() if largest < KEPT else beta(np.arange(largest + 1))


@cache
def _kept_betas() -> Float[np.ndarray, " K"]:
    return beta(np.arange(KEPT))


LOOP = BaseScheme("loop", place, split_triangles, limit_weight=limit_ring_weight)
