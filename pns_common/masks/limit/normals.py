"""Exact normals of Loop's limit surface at the vertices of a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import (
    Array,
    beside,
    cross,
    dot,
    gather,
    namespace,
    norm,
    segment_sum,
    unit,
    unit_longer_than,
)
from pns_common.connectivity.topology import Topology, sharp_edge_count
from pns_common.masks.limit.neighbours import Neighbours, own_neighbours
from pns_common.masks.limit.sectors import sectors
from pns_common.masks.limit.tangents import tangent_masks

# Tangents that span less than this, of the product of their lengths, span no plane.
NO_PLANE = 1e-9
# A sum of unit vectors below this, of the sum of their lengths, is what rounding leaves.
CANCELLED = 1e-9


@dataclass(frozen=True, eq=False)
class LimitNormals:
    """Unit normals; 0 where there is no area, and where those of a vertex's sectors cancel.

    Attributes:
        vertices: of each vertex; on a crease or where fans meet the unit mean of its sectors'.
        sectors: of each sector: one-sided at boundaries and creases.
        sector_of_corner: the sector of corner 3 f + i, for a normal at each face's corner.
    """

    vertices: Float[Array, "V 3"]
    sectors: Float[Array, "S 3"]
    sector_of_corner: Int[np.ndarray, " C"]


def limit_normals(points: Float[Array, "V 3"], topology: Topology) -> LimitNormals:
    """Return the normals of the limit surface at the limits of the vertices."""
    return normals_of_vertices(points, own_neighbours(topology))


def normals_of_vertices(points: Float[Array, "W 3"], neighbours: Neighbours) -> LimitNormals:
    """Return the normals at the first of ``points``, a mesh's vertices.

    Their neighbours are among all of ``points``.
    """
    topology = neighbours.topology
    around = sectors(topology)
    masks = tangent_masks(topology, around)
    count = len(around.size)
    corner = gather(points, topology.faces.reshape(-1))
    leaving = gather(points, neighbours.leaving) - corner
    arriving = gather(points, neighbours.arriving) - corner

    def tangent(which: int) -> Float[Array, "S 3"]:
        # Spokes in place of points: the centre's weight is minus the sum of the others.
        along = [
            beside(points, weights[:, which], points.dtype)[:, None] * spokes
            for weights, spokes in ((masks.leaving, leaving), (masks.arriving, arriving))
        ]
        return segment_sum(along[0] + along[1], around.of_corner, count)

    area = segment_sum(cross(leaving, arriving), around.of_corner, count)
    corners = ~around.closed & (sharp_edge_count(topology)[around.vertex] > 2)
    normals = plane_normals(tangent(0), tangent(1), area, corners)
    return LimitNormals(
        vertices=means_of_units(normals, around.vertex, topology.vertex_count),
        sectors=normals,
        sector_of_corner=around.of_corner,
    )


def means_of_units(
    normals: Float[Array, "S 3"], owners: Int[np.ndarray, " S"], count: int
) -> Float[Array, "V 3"]:
    """Return the unit mean of each owner's unit normals; 0 where they cancel.

    A sum that is small beside that of the lengths is rounding: it has no direction.
    """
    lengths = segment_sum(norm(normals)[:, None], owners, count)[:, 0]
    return unit_longer_than(segment_sum(normals, owners, count), CANCELLED * lengths)


def plane_normals(
    first: Float[Array, "S 3"],
    second: Float[Array, "S 3"],
    area: Float[Array, "S 3"],
    corners: np.ndarray | None = None,
) -> Float[Array, "S 3"]:
    """Return unit normals of the planes of two tangents; along ``area`` where they span none.

    The tangents of a corner wider than half a turn stand the other way round: there ``area`` says
    which way is out.
    """
    xp = namespace(first)
    across = cross(first, second)
    if corners is not None:
        turned = beside(first, corners) & (dot(across, area) < 0)
        across = xp.where(turned[:, None], -across, across)
    plane = norm(across) > NO_PLANE * norm(first) * norm(second)
    return unit(xp.where(plane[:, None], across, area))
