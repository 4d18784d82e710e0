"""Sectors around vertices, between sharp edges.

A sector holds the corners around a vertex between two edges that are not interior, anticlockwise;
or all corners of a closed fan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Integer

from pns_common.kernels.limit import label_sectors


@dataclass(frozen=True, eq=False)
class Sectors:
    """The corners around vertices between two sharp edges, or around a whole closed fan.

    Attributes:
        of_corner: the sector of each corner.
        first: the first corner of each sector, anticlockwise.
        size: how many corners it has.
        opened: how many sectors are open; these come first.
        vertex: of each sector.
        spokes: vertices around these, sector by sector; see ``kernels.limit``.
        starts: where the spokes of each sector begin, and their number at the end.
    """

    of_corner: Integer[np.ndarray, " C"]
    first: Integer[np.ndarray, " S"]
    size: Integer[np.ndarray, " S"]
    opened: int
    vertex: Integer[np.ndarray, " S"]
    spokes: Integer[np.ndarray, " K"]
    starts: Integer[np.ndarray, " S1"]


def find_sectors(mesh: Any, *, quads: bool = False) -> Sectors:
    """Return the sectors of a ``Connectivity``.

    ``quads``: with spokes in the quads that corners become.
    """
    corners = mesh.corners
    of_corner = np.full(len(corners), -1, dtype=np.int32)
    first, size = np.empty((2, len(corners)), dtype=np.int32)
    spokes = np.empty((3 if quads else 2) * len(corners), dtype=np.uint32)
    to = of_corner, first, size, spokes
    opened, count = label_sectors(mesh, quads, *to)
    first, size = first[:count].copy(), size[:count].copy()
    starts = np.append(0, np.cumsum(1 + (2 if quads else 1) * size.astype(np.int64)))
    return Sectors(of_corner, first, size, opened, corners[first], spokes, starts)
