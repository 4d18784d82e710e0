"""Where the vertices of a mesh end when Loop's rules go on for ever.

A limit mask is a left eigenvector of the local subdivision matrix for its eigenvalue 1. By the
number of sharp edges (boundary, irregular, crease) at a vertex:

    none       (1 − w_k) p + w_k (mean of the neighbours), w_k = 1 / (1 + 3 / (8 k β_k))
    one        (a dart) what its own matrix has, found by solving for it
    two        (4 p + the two neighbours along the curve) / 6
    more       p, which never moves

Where a face has a vertex twice an edge may lead from a vertex to itself. No later mesh has it, so
that vertex's mask is read in the next one.

All weights are ≥ 0 and sum to 1, so two control meshes that are ε apart have limits within ε.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, beside, gather, marked, namespace, scatter, segment_sum
from pns_common.connectivity.creases import crease_children, with_creases
from pns_common.connectivity.topology import (
    EdgeClass,
    Topology,
    build_topology,
    sharp_edge_count,
    split,
)
from pns_common.masks.limit.darts import dart_masks
from pns_common.masks.limit.neighbours import Neighbours, own_neighbours
from pns_common.masks.stencils import (
    CURVE_LIMIT_CENTRE,
    CURVE_LIMIT_NEIGHBOUR,
    limit_ring_weight,
    loop_edge_vertices,
    loop_vertex_vertices,
)


def limit_positions(points: Float[Array, "V K"], topology: Topology) -> Float[Array, "V K"]:
    """Return the limit of each vertex, or of any columns that Loop's masks refine."""
    limits = limits_of_vertices(points, own_neighbours(topology))
    to_itself = topology.edges[:, 0] == topology.edges[:, 1]
    if not to_itself.any():
        return limits
    xp, count = namespace(points), topology.vertex_count
    refined = xp.concat(
        [loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)]
    )
    plain = build_topology(split(topology), len(refined))
    after = with_creases(plain, crease_children(topology))
    later = limits_of_vertices(refined, own_neighbours(after))[:count]
    own = marked(topology.edges[to_itself, 0], count)
    return xp.where(beside(points, own)[:, None], later, limits)


def limits_of_vertices(points: Float[Array, "W K"], around: Neighbours) -> Float[Array, "V K"]:
    """Return the limits of the first of ``points``, a mesh's vertices.

    Their neighbours are among all of ``points``.
    """
    xp, topology = namespace(points), around.topology
    sharp, valence = sharp_edge_count(topology), topology.valence
    ring = limit_ring_weight(valence)
    smooth, curve = sharp == 0, sharp == 2
    centre = np.where(curve, CURVE_LIMIT_CENTRE, np.where(smooth, 1 - ring, 1.0))
    mean = ring / np.maximum(valence, 1)
    weight = np.where(curve, CURVE_LIMIT_NEIGHBOUR, np.where(smooth, mean, 0.0))

    every = slice(None)
    neighbours = _neighbour_sum(points, around, every)
    along = topology.edge_class != EdgeClass.INTERIOR
    if along.any():
        spokes = np.flatnonzero(np.repeat(along, 2))
        on_curve = beside(points, curve)[:, None]
        neighbours = xp.where(on_curve, _neighbour_sum(points, around, spokes), neighbours)
    centre, weight = (beside(points, part, points.dtype)[:, None] for part in (centre, weight))
    limits = centre * points[: topology.vertex_count] + weight * neighbours
    darts = dart_masks(topology)
    if len(darts.vertices):
        own, weights = (
            beside(points, part, points.dtype)[:, None] for part in (darts.centre, darts.weights)
        )
        ring = weights * gather(points, around.of_spokes[darts.spokes])
        at_darts = own * gather(points, darts.vertices) + segment_sum(
            ring, darts.of_dart, len(darts.vertices)
        )
        is_dart = beside(points, sharp == 1)[:, None]
        placed = scatter(at_darts, darts.vertices, topology.vertex_count)
        limits = xp.where(is_dart, placed, limits)
    return limits


def _neighbour_sum(
    points: Float[Array, "W K"], around: Neighbours, spokes: slice | Int[np.ndarray, " S"]
) -> Float[Array, "V K"]:
    ends = around.topology.edges.reshape(-1)[spokes]
    values = gather(points, around.of_spokes[spokes])
    return segment_sum(values, ends, around.topology.vertex_count)
