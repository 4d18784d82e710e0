"""Normals of limit surfaces, by tangent masks along the sectors around vertices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Integer, Shaped

from pns_common.kernels import limit as kernels
from pns_common.mesh.rows import norm, unit
from pns_common.mesh.sectors import Sectors, find_sectors
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks

CLOSED, DART, CURVE, CORNER = 0, 1, 2, 3
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

    vertices: Float[np.ndarray, "V 3"]
    sectors: Float[np.ndarray, "S 3"]
    sector_of_corner: Integer[np.ndarray, " C"]


def sector_kinds(topology: Topology, around: Sectors) -> Integer[np.ndarray, " S"]:
    """Return the kind of each sector: closed, or by the sharp edges at its vertex.

    A corner inside a smooth surface is the tip of a cone: its sector stays closed, and its normal
    is that of the ring.
    """
    kind = np.full(len(around.first), CLOSED, dtype=np.int64)
    if around.opened:
        sharp = topology.sharp_count
        if len(topology.vertex_sharpness):
            sharp = np.where((topology.corner_weights == 1) & (sharp == CURVE), CORNER, sharp)
        kind[: around.opened] = np.minimum(sharp[around.vertex[: around.opened]], CORNER)
    return kind


def sector_normals(
    points: Float[np.ndarray, "W 3"],
    topology: Topology,
    mask: Callable[[int, int], np.ndarray],
    blocks: Blocks,
    *,
    quads: bool = False,
) -> LimitNormals:
    """Return normals by tangent masks, ``mask(kind, size)``; ``points`` hold spokes too."""
    around = find_sectors(topology.connectivity, quads=quads)
    kind, count = sector_kinds(topology, around), topology.vertex_count
    at, masks = mask_tables(mask, kind, around.size)
    normals = np.empty((len(kind), 3))
    read = around.vertex, around.starts, around.spokes, at, masks, kind == CORNER
    blocks.run(len(kind), kernels.sector_normals, points, *read, normals)
    lengths = np.bincount(around.vertex, norm(normals), count)
    means = np.stack([np.bincount(around.vertex, own, count) for own in normals.T], axis=1)
    means[norm(means) <= CANCELLED * lengths] = 0.0
    return LimitNormals(unit(means), normals, around.of_corner)


def mask_tables(
    make: Callable[[int, int], np.ndarray],
    kind: Shaped[np.ndarray, " S"],
    size: Integer[np.ndarray, " S"],
) -> tuple[Integer[np.ndarray, " S"], Float[np.ndarray, " *M"]]:
    """Return ``make(kind, size)`` for all pairs that occur, in a row, and where each one begins."""
    keys, which = np.unique(4 * size.astype(np.int64) + kind, return_inverse=True)
    tables = [make(int(key % 4), int(key // 4)) for key in keys]
    starts = np.cumsum([0, *map(len, tables)])[:-1]
    return starts[which.reshape(-1)], np.concatenate(tables)
